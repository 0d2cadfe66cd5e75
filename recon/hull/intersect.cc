#include "recon/hull/intersect.h"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "recon/hull/intersect.cc"
#include <hwy/foreach_target.h>  // compiles this file once per instruction set
#include <hwy/highway.h>
#include <tbb/parallel_for.h>

#include <algorithm>
#include <bit>
#include <cstring>
#include <string>

#include "base/core/error.h"

HWY_BEFORE_NAMESPACE();
namespace v3d::recon::HWY_NAMESPACE {
namespace {

namespace hn = hwy::HWY_NAMESPACE;

#include "recon/simd_float.inc"
// These files use the types of simd_float.inc:
#include "recon/hull/simd_mask_window.inc"
#include "recon/hull/voxel_projection_steps.inc"
// These files use the files above:
#include "recon/hull/intersection_kernels.inc"

/// Descends from one node and collects bricks.
class Descent {
 public:
  Descent(const IntersectionScene& scene, std::vector<PlacedBrick>& bricks)
      : scene_(scene), bricks_(bricks) {}

  /// Calls visit(child) for the children that are still undecided. Carves undecided bricks at once.
  template <class Visit>
  void split(const OctreeNode& node, const Visit& visit);

  void descend(const OctreeNode& node) {
    split(node, [this](const OctreeNode& child) { descend(child); });
  }

 private:
  /// A child node with the cameras that are undecided about it.
  struct UndecidedChild {
    OctreeNode node;
    std::array<uint8_t, kMaxCameras> slot;  ///< index into the views of the parent
  };

  /// Collects the undecided cameras. Returns false when the child is empty.
  bool gather(int child, CameraList undecided, const CubeFootprints* views,
              UndecidedChild& open) const;
  void fill(const OctreeNode& node);
  void carve(int child, const UndecidedChild& open, const CubeFootprints* views);
  void emit(codec::BrickCoord at, const codec::Brick& bits) { bricks_.push_back({at, bits}); }

  const IntersectionScene& scene_;
  std::vector<PlacedBrick>& bricks_;
};

template <class Visit>
void Descent::split(const OctreeNode& node, const Visit& visit) {
  CubeFootprints views[kMaxCameras];  // NOLINT: only what is written is read
  unsigned alive = children_inside(scene_.grid, node);
  for (int n = 0; n < node.undecided_count; ++n) {
    const int camera = node.undecided[n];
    project_cubes(scene_, node, camera, alive, views[n]);
    alive &= ~(views[n].sees_all & views[n].none);
    if (alive == 0) return;
  }
  UndecidedChild open;
  for (; alive != 0; alive &= alive - 1) {
    const int n = std::countr_zero(alive);
    const int half = 1 << (node.level - 1);
    open.node.level = node.level - 1;
    open.node.at = {node.at.x + (n & 1) * half, node.at.y + (n >> 1 & 1) * half,
                    node.at.z + (n >> 2) * half};
    open.node.full_views = node.full_views;
    if (!gather(n, node.cameras(), views, open)) continue;
    if (open.node.undecided_count == 0) {
      fill(open.node);
    } else if (open.node.level == 0) {
      carve(n, open, views);
    } else {
      visit(open.node);
    }
  }
}

bool Descent::gather(int child, CameraList undecided, const CubeFootprints* views,
                     UndecidedChild& open) const {
  std::array<uint8_t, kMaxCameras> harmless;  // partly seen, no background there
  size_t kept_count = 0;
  size_t harmless_count = 0;
  int sees_all = open.node.full_views;
  for (size_t n = 0; n < undecided.size(); ++n) {
    const auto has = [&](unsigned children) { return (children >> child & 1) != 0; };
    if (!has(views[n].may_see)) continue;
    sees_all += has(views[n].sees_all);
    if (!has(views[n].all)) {
      open.slot[kept_count++] = static_cast<uint8_t>(n);
    } else if (has(views[n].sees_all)) {
      ++open.node.full_views;
    } else {
      harmless[harmless_count++] = static_cast<uint8_t>(n);
    }
  }
  // A camera without background here cannot carve. Keep it only where voxels may have fewer than
  // min_views views.
  if (sees_all < scene_.min_views) {
    if (open.node.full_views + kept_count + harmless_count <
        static_cast<size_t>(scene_.min_views)) {
      return false;
    }
    std::copy_n(harmless.begin(), harmless_count, open.slot.begin() + kept_count);
    kept_count += harmless_count;
  }
  open.node.undecided_count = static_cast<int>(kept_count);
  for (size_t n = 0; n < kept_count; ++n) open.node.undecided[n] = undecided[open.slot[n]];
  return true;
}

void Descent::fill(const OctreeNode& node) {
  const int edge = 1 << node.level;
  for (int z = 0; z < edge; ++z) {
    for (int y = 0; y < edge; ++y) {
      for (int x = 0; x < edge; ++x) {
        const codec::BrickCoord at{node.at.x + x, node.at.y + y, node.at.z + z};
        const codec::Brick bits = bits_inside(scene_.grid, at);
        if (bits != codec::Brick{}) emit(at, bits);
      }
    }
  }
}

/// Removes from `bits` the voxels that have fewer than `needed` views among `seen`.
void keep_well_seen(codec::Brick& bits, std::span<const codec::Brick> seen, int needed) {
  for (size_t z = 0; z < bits.size(); ++z) {
    for (uint64_t voxels = bits[z]; voxels != 0; voxels &= voxels - 1) {
      const int voxel = std::countr_zero(voxels);
      int views = 0;
      for (const codec::Brick& brick : seen) views += static_cast<int>(brick[z] >> voxel & 1);
      if (views < needed) bits[z] &= ~(uint64_t{1} << voxel);
    }
  }
}

void Descent::carve(int child, const UndecidedChild& open, const CubeFootprints* views) {
  const OctreeNode& node = open.node;
  codec::Brick bits = bits_inside(scene_.grid, node.at);
  const bool is_whole = bits == codec::kFullBrick;
  codec::Brick seen[kMaxCameras];  // NOLINT: only what is written is read
  size_t count = 0;
  for (int n = 0; n < node.undecided_count; ++n) {
    const int camera = node.undecided[n];
    test_brick(scene_.cameras[camera], scene_.masks[camera], node.at, views[open.slot[n]].of(child),
               is_whole, bits, seen[count++]);
    if (bits == codec::Brick{}) return;
  }
  if (node.full_views < scene_.min_views) {
    keep_well_seen(bits, {seen, count}, scene_.min_views - node.full_views);
  }
  if (bits != codec::Brick{}) emit(node.at, bits);
}

void split_one(const IntersectionScene& scene, const OctreeNode& node,
               std::vector<OctreeNode>& nodes, std::vector<PlacedBrick>& bricks) {
  Descent(scene, bricks).split(node, [&](const OctreeNode& child) { nodes.push_back(child); });
}

void carve_all(const IntersectionScene& scene, const OctreeNode& node,
               std::vector<PlacedBrick>& bricks) {
  Descent(scene, bricks).descend(node);
}

std::array<CubeFootprint, 8> views_of(const IntersectionScene& scene, const OctreeNode& node,
                                      int camera) {
  CubeFootprints views;
  project_cubes(scene, node, camera, children_inside(scene.grid, node), views);
  std::array<CubeFootprint, 8> result;
  for (int n = 0; n < 8; ++n) result[n] = views.of(n);
  return result;
}

}  // namespace
}  // namespace v3d::recon::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace v3d::recon {

HWY_EXPORT(split_one);
HWY_EXPORT(carve_all);
HWY_EXPORT(views_of);

void split_node(const IntersectionScene& scene, const OctreeNode& node,
                std::vector<OctreeNode>& nodes, std::vector<PlacedBrick>& bricks) {
  HWY_DYNAMIC_DISPATCH(split_one)(scene, node, nodes, bricks);
}

void intersect_node(const IntersectionScene& scene, const OctreeNode& node,
                    std::vector<PlacedBrick>& bricks) {
  HWY_DYNAMIC_DISPATCH(carve_all)(scene, node, bricks);
}

std::array<CubeFootprint, 8> child_footprints(const IntersectionScene& scene,
                                              const OctreeNode& node, int camera) {
  return HWY_DYNAMIC_DISPATCH(views_of)(scene, node, camera);
}

namespace {

/// Number of parallel tasks from which on all threads stay busy until the end.
constexpr size_t kEnoughNodes = 128;

}  // namespace

Intersector::Intersector(const VoxelGrid& grid, std::span<const CameraModel> cameras, int min_views)
    : grid_(grid), min_views_(min_views) {
  if (cameras.size() > kMaxCameras) {
    throw InputError("rig: " + std::to_string(cameras.size()) + " cameras, at most " +
                     std::to_string(kMaxCameras) + " are possible");
  }
  if (min_views < 1) {
    throw InputError("min_views: " + std::to_string(min_views) + ", must be 1 or more");
  }
  if (std::ranges::max(grid.counts) > VoxelGrid::kMaxCount) {
    throw InputError("voxel size: more than " + std::to_string(VoxelGrid::kMaxCount) +
                     " voxels along an axis");
  }
  for (const CameraModel& camera : cameras) {
    cameras_.emplace_back(camera, grid);
    masks_.emplace_back(camera.size());
  }
  nodes_.reserve(8 * kEnoughNodes);
  next_.reserve(8 * kEnoughNodes);
}

SparseVolume Intersector::intersect(std::span<const Mask* const> masks) {
  SparseVolume volume;
  intersect(masks, volume);
  return volume;
}

void Intersector::intersect(std::span<const Mask* const> masks, SparseVolume& volume) {
  V3D_CHECK(masks.size() == cameras_.size());
  tbb::parallel_for(size_t{0}, masks.size(), [&](size_t c) {
    if (masks[c] != nullptr) masks_[c].build(*masks[c]);
  });
  const IntersectionScene scene{grid_, cameras_, masks_, min_views_};
  for (auto& bricks : found_) bricks.clear();
  nodes_.assign(1, above_root(masks));
  while (!nodes_.empty() && nodes_.size() < kEnoughNodes && nodes_.front().level > 1) {
    next_.clear();
    for (const OctreeNode& node : nodes_) split_node(scene, node, next_, found_.local());
    std::swap(nodes_, next_);
  }
  tbb::parallel_for(
      tbb::blocked_range<size_t>(0, nodes_.size(), 1),
      [&](const auto& range) {
        std::vector<PlacedBrick>& bricks = found_.local();
        for (size_t n = range.begin(); n < range.end(); ++n)
          intersect_node(scene, nodes_[n], bricks);
      },
      tbb::simple_partitioner());
  parts_.clear();
  for (const auto& bricks : found_) parts_.emplace_back(bricks);
  volume.assign(grid_, parts_);
}

OctreeNode Intersector::above_root(std::span<const Mask* const> masks) const {
  OctreeNode node;
  const auto bricks =
      static_cast<uint64_t>((std::ranges::max(grid_.counts) + 7) / codec::kBrickEdge);
  // Nodes are tested when their parent is split. So this node is the parent of the whole space,
  // which is its first child.
  node.level = std::bit_width(bricks - 1) + 1;
  for (size_t c = 0; c < masks.size(); ++c) {
    if (masks[c] != nullptr) node.undecided[node.undecided_count++] = static_cast<uint16_t>(c);
  }
  return node;
}

}  // namespace v3d::recon
#endif
