#include "recon/hull/intersection_octree.h"

// Vector registers of unknown length cannot be members of a struct.
#define HWY_DISABLED_TARGETS (HWY_SVE | HWY_SVE2 | HWY_SVE_256 | HWY_SVE2_128 | HWY_RVV)
#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "recon/hull/intersection_octree.cc"
#include <hwy/foreach_target.h>  // compiles this file once per instruction set
#include <hwy/highway.h>

#include <algorithm>
#include <bit>
#include <cstring>

HWY_BEFORE_NAMESPACE();
namespace v3d::HWY_NAMESPACE {
namespace {

namespace hn = hwy::HWY_NAMESPACE;

#include "recon/simd_float.inc"
// These files use the types of simd_float.inc:
#include "recon/hull/simd_interval.inc"
#include "recon/hull/simd_mask_window.inc"
#include "recon/hull/voxel_projection_steps.inc"
// These files use the files above:
#include "recon/hull/simd_brick_test.inc"
#include "recon/hull/simd_cube_footprints.inc"

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
  void emit(BrickCoord at, const Brick& bits) { bricks_.push_back({at, bits}); }

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
        const BrickCoord at{node.at.x + x, node.at.y + y, node.at.z + z};
        const Brick bits = bits_inside(scene_.grid, at);
        if (bits != Brick{}) emit(at, bits);
      }
    }
  }
}

/// Removes from `bits` the voxels that have fewer than `needed` views among `seen`.
void keep_well_seen(Brick& bits, std::span<const Brick> seen, int needed) {
  for (size_t z = 0; z < bits.size(); ++z) {
    for (uint64_t voxels = bits[z]; voxels != 0; voxels &= voxels - 1) {
      const int voxel = std::countr_zero(voxels);
      int views = 0;
      for (const Brick& brick : seen) views += static_cast<int>(brick[z] >> voxel & 1);
      if (views < needed) bits[z] &= ~(uint64_t{1} << voxel);
    }
  }
}

void Descent::carve(int child, const UndecidedChild& open, const CubeFootprints* views) {
  const OctreeNode& node = open.node;
  Brick bits = bits_inside(scene_.grid, node.at);
  const bool is_whole = bits == kFullBrick;
  Brick seen[kMaxCameras];  // NOLINT: only what is written is read
  size_t count = 0;
  for (int n = 0; n < node.undecided_count; ++n) {
    const int camera = node.undecided[n];
    test_brick(scene_.cameras[camera], scene_.masks[camera], node.at, views[open.slot[n]].of(child),
               is_whole, bits, seen[count++]);
    if (bits == Brick{}) return;
  }
  if (node.full_views < scene_.min_views) {
    keep_well_seen(bits, {seen, count}, scene_.min_views - node.full_views);
  }
  if (bits != Brick{}) emit(node.at, bits);
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
}  // namespace v3d::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace v3d {

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

}  // namespace v3d
#endif
