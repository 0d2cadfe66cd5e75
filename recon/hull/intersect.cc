#include "recon/hull/intersect.h"

#include <tbb/parallel_for.h>

#include <algorithm>
#include <bit>
#include <string>

#include "base/core/check.h"
#include "base/core/error.h"

namespace v3d {
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
  const auto bricks = static_cast<uint64_t>((std::ranges::max(grid_.counts) + 7) / kBrickEdge);
  // Nodes are tested when their parent is split. So this node is the parent of the whole space,
  // which is its first child.
  node.level = std::bit_width(bricks - 1) + 1;
  for (size_t c = 0; c < masks.size(); ++c) {
    if (masks[c] != nullptr) node.undecided[node.undecided_count++] = static_cast<uint16_t>(c);
  }
  return node;
}

}  // namespace v3d
