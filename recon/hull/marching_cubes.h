// Discrete marching cubes: the surface of a volume. Source: Kenmochi et al. [7] of the paper, as
// used in section 2.3. codec/brick_surface.h contains the implementation, because the decoder of
// compact frames uses it too.
#pragma once

#include <memory>

#include "base/geometry/mesh.h"
#include "recon/hull/sparse_volume.h"

namespace v3d {

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

}  // namespace v3d
