#include "recon/sparse_volume.h"

#include <tbb/parallel_for.h>
#include <tbb/parallel_sort.h>

#include <algorithm>
#include <bit>
#include <cassert>
#include <utility>

namespace v3d {

Brick bits_inside(const VoxelGrid& grid, BrickCoord at) {
  const auto inside = [](int64_t count, int brick) {
    return static_cast<int>(std::clamp<int64_t>(count - int64_t{kBrickEdge} * brick, 0, 8));
  };
  const int nx = inside(grid.counts[0], at.x);
  const int ny = inside(grid.counts[1], at.y);
  const int nz = inside(grid.counts[2], at.z);
  uint64_t layer = 0;
  for (int y = 0; y < ny; ++y) {
    layer |= ((uint64_t{1} << nx) - 1) << (kBrickEdge * y);
  }
  Brick bits{};
  std::fill_n(bits.begin(), nz, layer);
  return bits;
}

SparseVolume::SparseVolume(const VoxelGrid& grid) : grid_(grid) {
  size_t total = 1;
  for (int axis = 0; axis < 3; ++axis) {
    assert(grid.counts[axis] > 0 && grid.counts[axis] <= VoxelGrid::kMaxCount);
    brick_counts_[axis] = static_cast<int>((grid.counts[axis] + kBrickEdge - 1) / kBrickEdge);
    total *= brick_counts_[axis];
  }
  table_.assign(total, -1);
}

SparseVolume::SparseVolume(const VoxelGrid& grid,
                           std::span<const std::span<const PlacedBrick>> parts)
    : SparseVolume(grid) {
  std::vector<std::pair<size_t, const PlacedBrick*>> order;
  for (const auto& part : parts) {
    for (const PlacedBrick& brick : part) {
      if (brick.bits != Brick{}) order.emplace_back(linear(brick.at), &brick);
    }
  }
  tbb::parallel_sort(order.begin(), order.end());
  bricks_.resize(order.size());
  coords_.resize(order.size());
  tbb::parallel_for(size_t{0}, order.size(), [&](size_t n) {
    bricks_[n] = order[n].second->bits;
    coords_[n] = order[n].second->at;
    table_[order[n].first] = static_cast<int32_t>(n);
  });
}

bool SparseVolume::get(int i, int j, int k) const {
  if (!grid_.contains(i, j, k)) return false;
  const int brick = index_of({i / kBrickEdge, j / kBrickEdge, k / kBrickEdge});
  return brick >= 0 &&
         (bricks_[brick][k % kBrickEdge] >> (kBrickEdge * (j % kBrickEdge) + i % kBrickEdge) & 1) !=
             0;
}

int64_t SparseVolume::count() const {
  int64_t n = 0;
  for (const Brick& brick : bricks_) {
    for (const uint64_t word : brick) n += std::popcount(word);
  }
  return n;
}

}  // namespace v3d
