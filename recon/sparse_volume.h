// The volume: which voxels of a grid are occupied, stored only where there are any.
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "recon/voxel_grid.h"

namespace v3d {

/// 8 x 8 x 8 voxels: voxel (x, y, z) of the brick is bit 8 * y + x (least significant first) of
/// word z.
using Brick = std::array<uint64_t, 8>;

inline constexpr int kBrickEdge = 8;

/// Brick (x, y, z) holds voxels 8x .. 8x+7, 8y .. 8y+7, 8z .. 8z+7.
struct BrickCoord {
  int x = 0;
  int y = 0;
  int z = 0;
  friend bool operator==(const BrickCoord&, const BrickCoord&) = default;
};

struct PlacedBrick {
  BrickCoord at;
  Brick bits{};
};

/// The bits of brick `at` that lie inside the grid.
Brick bits_inside(const VoxelGrid& grid, BrickCoord at);

/// A value; safe to read from any thread. Invariants: no stored brick is empty; bits outside the
/// grid are 0; bricks are sorted by z, then y, then x. So equal volumes have equal bytes.
class SparseVolume {
 public:
  SparseVolume() = default;
  /// No voxel occupied.
  explicit SparseVolume(const VoxelGrid& grid);
  /// `parts` hold distinct bricks in any order, with no bit outside the grid; empty ones are left
  /// out. The result does not depend on the order, nor on how they are spread over the parts. Runs
  /// in the caller's TBB arena.
  SparseVolume(const VoxelGrid& grid, std::span<const std::span<const PlacedBrick>> parts);

  const VoxelGrid& grid() const { return grid_; }
  /// Bricks along each axis, occupied or not.
  const std::array<int, 3>& brick_counts() const { return brick_counts_; }

  /// The occupied bricks, sorted; coords()[n] is where bricks()[n] lies.
  std::span<const Brick> bricks() const { return bricks_; }
  std::span<const BrickCoord> coords() const { return coords_; }

  /// Index into bricks(), -1 for an empty brick and outside the grid.
  int index_of(BrickCoord at) const {
    if (at.x < 0 || at.y < 0 || at.z < 0 || at.x >= brick_counts_[0] || at.y >= brick_counts_[1] ||
        at.z >= brick_counts_[2]) {
      return -1;
    }
    return table_[linear(at)];
  }

  /// Outside the grid everything is empty.
  bool get(int i, int j, int k) const;
  /// Occupied voxels.
  int64_t count() const;

  friend bool operator==(const SparseVolume& a, const SparseVolume& b) {
    return a.grid_ == b.grid_ && a.coords_ == b.coords_ && a.bricks_ == b.bricks_;
  }

 private:
  size_t linear(BrickCoord at) const {
    return (static_cast<size_t>(at.z) * brick_counts_[1] + at.y) * brick_counts_[0] + at.x;
  }

  VoxelGrid grid_;
  std::array<int, 3> brick_counts_{};
  std::vector<Brick> bricks_;
  std::vector<BrickCoord> coords_;
  std::vector<int32_t> table_;  ///< linear() to index, -1 where empty
};

}  // namespace v3d
