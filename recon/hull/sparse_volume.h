// Sparse volume: the occupied voxels of a grid, stored in bricks of 8 x 8 x 8 voxels.
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "codec/brick.h"
#include "codec/brick_map.h"
#include "codec/brick_surface.h"
#include "recon/hull/voxel_grid.h"

namespace v3d {

struct PlacedBrick {
  BrickCoord at;
  Brick bits{};
};

/// The bits of brick `at` that lie inside the grid.
Brick bits_inside(const VoxelGrid& grid, BrickCoord at);

/// A value; any thread may read. Invariants: no stored brick is empty; bits outside the grid are 0;
/// bricks are sorted by z, then y, then x. So equal volumes have equal bytes.
class SparseVolume {
 public:
  SparseVolume() = default;
  /// No voxel occupied.
  explicit SparseVolume(const VoxelGrid& grid);
  /// `parts` hold distinct bricks in any order, with no bit outside the grid. Empty bricks are left
  /// out. The result depends neither on the order nor on the division into parts. Works in the
  /// caller's TBB arena.
  SparseVolume(const VoxelGrid& grid, std::span<const std::span<const PlacedBrick>> parts);
  /// Like the constructor; reuses the memory.
  void assign(const VoxelGrid& grid, std::span<const std::span<const PlacedBrick>> parts);

  const VoxelGrid& grid() const { return grid_; }
  /// Bricks of the grid along each axis, empty ones included.
  const std::array<int, 3>& brick_counts() const { return occupied_.counts(); }

  /// The stored bricks, sorted; coords()[n] is the place of bricks()[n].
  std::span<const Brick> bricks() const { return bricks_; }
  std::span<const BrickCoord> coords() const { return coords_; }

  /// Index into bricks(), -1 for an empty brick and outside the grid.
  int index_of(BrickCoord at) const { return occupied_.index_of(at); }
  /// The bricks that are stored.
  const BrickMap& occupied() const { return occupied_; }
  BrickVolume view() const { return {&occupied_, bricks_, coords_}; }

  /// True for an occupied voxel; false outside the grid.
  bool get(int i, int j, int k) const;
  /// Number of occupied voxels.
  int64_t count() const;

  friend bool operator==(const SparseVolume& a, const SparseVolume& b) {
    return a.grid_ == b.grid_ && a.coords_ == b.coords_ && a.bricks_ == b.bricks_;
  }

 private:
  /// Sets the bits of the occupied bricks and makes room for them.
  void mark(std::span<const std::span<const PlacedBrick>> parts);
  void place(std::span<const std::span<const PlacedBrick>> parts);

  VoxelGrid grid_;
  std::vector<Brick> bricks_;
  std::vector<BrickCoord> coords_;
  BrickMap occupied_;
};

/// Number of voxels that are occupied in both volumes. Requires the same grid.
int64_t count_common(const SparseVolume& a, const SparseVolume& b);
/// Number of voxels that are occupied in one of the volumes. Requires the same grid.
int64_t count_differing(const SparseVolume& a, const SparseVolume& b);

}  // namespace v3d
