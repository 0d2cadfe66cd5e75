// The volume: which voxels of a grid are occupied, stored only where there are any.
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
  /// As if newly constructed; keeps its memory.
  void assign(const VoxelGrid& grid, std::span<const std::span<const PlacedBrick>> parts);

  const VoxelGrid& grid() const { return grid_; }
  /// Bricks along each axis, occupied or not.
  const std::array<int, 3>& brick_counts() const { return occupied_.counts(); }

  /// The occupied bricks, sorted; coords()[n] is where bricks()[n] lies.
  std::span<const Brick> bricks() const { return bricks_; }
  std::span<const BrickCoord> coords() const { return coords_; }

  /// Index into bricks(), -1 for an empty brick and outside the grid.
  int index_of(BrickCoord at) const { return occupied_.index_of(at); }
  /// The bricks that are stored.
  const BrickMap& occupied() const { return occupied_; }
  BrickVolume view() const { return {&occupied_, bricks_, coords_}; }

  /// Outside the grid everything is empty.
  bool get(int i, int j, int k) const;
  /// Occupied voxels.
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

/// Voxels that both have. Requires the same grid, here and below.
int64_t count_common(const SparseVolume& a, const SparseVolume& b);
/// Voxels that one has and the other has not.
int64_t count_differing(const SparseVolume& a, const SparseVolume& b);

}  // namespace v3d
