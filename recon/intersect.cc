#include "recon/intersect.h"

#include <tbb/enumerable_thread_specific.h>
#include <tbb/parallel_for.h>

#include <algorithm>
#include <array>
#include <bit>
#include <cassert>
#include <cstdint>
#include <string>

#include "base/error.h"
#include "recon/carve_brick.h"
#include "recon/interval.h"

namespace v3d {
namespace {

using CameraList = std::span<const uint16_t>;

/// A cube of 2^level bricks along each edge.
struct Node {
  int level = 0;
  BrickCoord at;  ///< its first brick
};

/// What a camera knows about all voxels of a node.
struct NodeView {
  bool may_see = true;                ///< false: sees none of the voxels
  bool sees_all = false;              ///< sees every voxel, for certain
  Coverage pixels = Coverage::kSome;  ///< of the pixels at which it may see voxels
};

/// From this level on, the children of a node are tasks of their own.
constexpr int kTaskLevel = 2;

/// One volume being made: descends the octree and collects occupied bricks.
class Descent {
 public:
  Descent(const VoxelGrid& grid, std::span<const VoxelCamera> cameras,
          std::span<const MaskPyramid> masks, int min_views)
      : grid_(grid), cameras_(cameras), masks_(masks), min_views_(min_views) {}

  /// `undecided` are the cameras that may see the node on background; `full_views` further cameras
  /// see all of it on foreground. The cameras that are in neither see none of it, or cannot change
  /// the result.
  void descend(const Node& node, CameraList undecided, int full_views);

  SparseVolume volume() const;

 private:
  NodeView view(const Node& node, int camera) const;
  void split(const Node& node, CameraList undecided, int full_views);
  void fill(const Node& node);
  void carve(BrickCoord at, CameraList undecided, int full_views);
  bool outside(const Node& node) const;
  void emit(BrickCoord at, const Brick& bits) { found_.local().push_back({at, bits}); }

  const VoxelGrid& grid_;
  std::span<const VoxelCamera> cameras_;
  std::span<const MaskPyramid> masks_;
  int min_views_;
  tbb::enumerable_thread_specific<std::vector<PlacedBrick>> found_;
};

/// Indices of the voxels of a node along one axis.
Interval voxel_range(int first_brick, int level, int64_t count) {
  const int64_t end = int64_t{kBrickEdge} * (first_brick + (int64_t{1} << level));
  return {static_cast<float>(kBrickEdge * first_brick),
          static_cast<float>(std::min(end, count) - 1)};
}

bool Descent::outside(const Node& node) const { return bits_inside(grid_, node.at) == Brick{}; }

NodeView Descent::view(const Node& node, int camera) const {
  const VoxelCamera& c = cameras_[camera];
  const auto p = camera_point<Interval>(c, voxel_range(node.at.x, node.level, grid_.counts[0]),
                                        voxel_range(node.at.y, node.level, grid_.counts[1]),
                                        voxel_range(node.at.z, node.level, grid_.counts[2]));
  if (p.z.hi <= 0) return {.may_see = false};
  if (!(p.z.lo > 0)) return {};
  const PixelPoint<Interval> q = pixel_point(c, p);
  if (q.radius2.lo > c.max_radius2 || q.u.hi < 0 || q.v.hi < 0 || q.u.lo >= c.width ||
      q.v.lo >= c.height) {
    return {.may_see = false};
  }
  NodeView view;
  view.sees_all = q.radius2.hi <= c.max_radius2 &&
                  q.radius2.hi < std::numeric_limits<float>::infinity() && q.u.lo >= 0 &&
                  q.v.lo >= 0 && q.u.hi < c.width && q.v.hi < c.height;
  // Truncation is floor(): nothing is negative after the clamp.
  view.pixels = masks_[camera].coverage(static_cast<int>(std::max(q.u.lo, 0.0F)),
                                        static_cast<int>(std::max(q.v.lo, 0.0F)),
                                        static_cast<int>(std::min(q.u.hi, c.width - 1)),
                                        static_cast<int>(std::min(q.v.hi, c.height - 1)));
  return view;
}

void Descent::descend(const Node& node, CameraList undecided, int full_views) {
  if (outside(node)) return;
  std::array<uint16_t, Intersector::kMaxCameras> kept;
  std::array<uint16_t, Intersector::kMaxCameras> harmless;  // partly seen, no background there
  size_t kept_count = 0;
  size_t harmless_count = 0;
  int sees_all = full_views;
  for (const uint16_t camera : undecided) {
    const NodeView v = view(node, camera);
    if (!v.may_see) continue;
    if (v.sees_all && v.pixels == Coverage::kNone) return;
    sees_all += v.sees_all;
    if (v.pixels != Coverage::kAll) {
      kept[kept_count++] = camera;
    } else if (v.sees_all) {
      ++full_views;
    } else {
      harmless[harmless_count++] = camera;
    }
  }
  // A camera that cannot carve matters only while voxels may lack views.
  if (sees_all < min_views_) {
    if (full_views + kept_count + harmless_count < static_cast<size_t>(min_views_)) return;
    std::copy_n(harmless.begin(), harmless_count, kept.begin() + kept_count);
    kept_count += harmless_count;
  }
  const CameraList rest(kept.data(), kept_count);
  if (rest.empty()) {
    fill(node);
  } else if (node.level == 0) {
    carve(node.at, rest, full_views);
  } else {
    split(node, rest, full_views);
  }
}

void Descent::split(const Node& node, CameraList undecided, int full_views) {
  const auto child = [&](int n) {
    const int half = 1 << (node.level - 1);
    const BrickCoord at{node.at.x + (n & 1) * half, node.at.y + (n >> 1 & 1) * half,
                        node.at.z + (n >> 2) * half};
    descend({node.level - 1, at}, undecided, full_views);
  };
  if (node.level >= kTaskLevel) {
    tbb::parallel_for(0, 8, child);
  } else {
    for (int n = 0; n < 8; ++n) child(n);
  }
}

void Descent::fill(const Node& node) {
  const int edge = 1 << node.level;
  for (int z = 0; z < edge; ++z) {
    for (int y = 0; y < edge; ++y) {
      for (int x = 0; x < edge; ++x) {
        const BrickCoord at{node.at.x + x, node.at.y + y, node.at.z + z};
        const Brick bits = bits_inside(grid_, at);
        if (bits != Brick{}) emit(at, bits);
      }
    }
  }
}

/// Takes from `bits` the voxels that have fewer than `needed` views among `seen`.
void keep_well_seen(Brick& bits, std::span<const Brick> seen, int needed) {
  for (size_t z = 0; z < bits.size(); ++z) {
    for (uint64_t rest = bits[z]; rest != 0; rest &= rest - 1) {
      const int voxel = std::countr_zero(rest);
      int views = 0;
      for (const Brick& brick : seen) views += static_cast<int>(brick[z] >> voxel & 1);
      if (views < needed) bits[z] &= ~(uint64_t{1} << voxel);
    }
  }
}

void Descent::carve(BrickCoord at, CameraList undecided, int full_views) {
  Brick bits = bits_inside(grid_, at);
  std::array<Brick, Intersector::kMaxCameras> seen;
  size_t views = 0;
  for (const uint16_t camera : undecided) {
    const BrickView v = view_brick(cameras_[camera], masks_[camera], at, bits);
    for (size_t z = 0; z < bits.size(); ++z) bits[z] &= ~v.background[z];
    if (bits == Brick{}) return;
    seen[views++] = v.seen;
  }
  if (full_views < min_views_) {
    keep_well_seen(bits, {seen.data(), views}, min_views_ - full_views);
  }
  if (bits != Brick{}) emit(at, bits);
}

SparseVolume Descent::volume() const {
  std::vector<std::span<const PlacedBrick>> parts;
  for (const auto& bricks : found_) parts.emplace_back(bricks);
  return SparseVolume(grid_, parts);
}

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
}

SparseVolume Intersector::intersect(std::span<const Mask* const> masks) {
  assert(masks.size() == cameras_.size());
  std::vector<uint16_t> present;
  for (size_t c = 0; c < masks.size(); ++c) {
    if (masks[c] != nullptr) present.push_back(static_cast<uint16_t>(c));
  }
  tbb::parallel_for(size_t{0}, present.size(),
                    [&](size_t n) { masks_[present[n]].build(*masks[present[n]]); });
  Node root;
  const auto bricks = static_cast<uint64_t>((std::ranges::max(grid_.counts) + 7) / kBrickEdge);
  root.level = std::bit_width(bricks - 1);
  Descent descent(grid_, cameras_, masks_, min_views_);
  descent.descend(root, present, 0);
  return descent.volume();
}

}  // namespace v3d
