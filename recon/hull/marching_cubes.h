// Discrete marching cubes: the surface of a volume, as used by Takai et al., "3D Video
// Technologies", section 2.3. How it is made: codec/brick_surface.h, which the decoder of compact
// frames shares.
#pragma once

#include <memory>

#include "base/mesh.h"
#include "recon/hull/sparse_volume.h"

namespace v3d {

/// Makes surfaces of volumes and keeps its working memory. One caller at a time; works in the
/// caller's TBB arena.
class MarchingCubes {
 public:
  MarchingCubes();
  ~MarchingCubes();

  /// `mesh` becomes the volume's surface, without colours; its memory is used again.
  ///
  /// A vertex stands midway between every occupied voxel centre and its empty neighbours along the
  /// axes; outside the grid everything is empty. So vertices lie on a lattice of half voxels:
  /// float(origin + h * voxel_m / 2) per axis with a whole number h, computed in double, to the
  /// bit. The mesh is closed and 2-manifold whatever the volume, without exception: voxels that
  /// touch along an edge are joined, voxels that touch at a corner only are apart. Triangles are
  /// counter-clockwise seen from the empty side. Vertices are in the order of the bricks (z, y, x)
  /// and then of axis and voxel, triangles in that of their cubes. The result depends on the volume
  /// alone.
  void run(const SparseVolume& volume, Mesh& mesh);

 private:
  class Surface;
  std::unique_ptr<Surface> surface_;
};

/// The same for once.
Mesh marching_cubes(const SparseVolume& volume);

}  // namespace v3d
