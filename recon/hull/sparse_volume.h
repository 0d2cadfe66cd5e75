// Sparse volume and its surface.
#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "base/geometry/mesh.h"
#include "codec/bricks.h"
#include "recon/hull/voxel_grid.h"

namespace v3d::recon {

// Sparse volume: the occupied voxels of a grid, stored in bricks of 8 x 8 x 8 voxels.

struct PlacedBrick {
  codec::BrickCoord at;
  codec::Brick bits{};
};

/// The bits of brick `at` that lie inside the grid.
codec::Brick bits_inside(const VoxelGrid& grid, codec::BrickCoord at);

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
  std::span<const codec::Brick> bricks() const { return bricks_; }
  std::span<const codec::BrickCoord> coords() const { return coords_; }

  /// Index into bricks(), -1 for an empty brick and outside the grid.
  int index_of(codec::BrickCoord at) const { return occupied_.index_of(at); }
  /// The bricks that are stored.
  const codec::BrickMap& occupied() const { return occupied_; }
  codec::BrickVolume view() const { return {&occupied_, bricks_, coords_}; }

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
  std::vector<codec::Brick> bricks_;
  std::vector<codec::BrickCoord> coords_;
  codec::BrickMap occupied_;
};

/// Number of voxels that are occupied in both volumes. Requires the same grid.
int64_t count_common(const SparseVolume& a, const SparseVolume& b);
/// Number of voxels that are occupied in one of the volumes. Requires the same grid.
int64_t count_differing(const SparseVolume& a, const SparseVolume& b);

// Discrete marching cubes: the surface of a volume. Source: Kenmochi et al. [7] of the paper, as
// used in section 2.3. codec/bricks.h contains the implementation, because the decoder of
// compact frames uses it too.

/// Keeps its working memory between calls. One caller at a time; works in the caller's TBB arena.
class MarchingCubes {
 public:
  MarchingCubes();
  ~MarchingCubes();

  /// Replaces `mesh` by the surface of `volume`, without colours, and reuses its memory.
  ///
  /// A vertex lies midway between each occupied voxel centre and each of its empty neighbours along
  /// the axes; outside the grid everything is empty. So vertices lie on a lattice of half voxels
  /// (world frame, metres): float(origin + h * voxel_m / 2) per axis with an integer h, computed in
  /// double, to the bit. Triangles are counter-clockwise seen from outside.
  ///
  /// The surface is closed and 2-manifold for every volume: voxels that share an edge are
  /// connected, voxels that share only a corner are not. Vertices are sorted by brick (z, y, x),
  /// then axis and voxel; triangles by cube. Deterministic.
  void run(const SparseVolume& volume, Mesh& mesh);

 private:
  class Surface;
  std::unique_ptr<Surface> surface_;
};

/// MarchingCubes::run() without kept memory.
Mesh marching_cubes(const SparseVolume& volume);

}  // namespace v3d::recon
