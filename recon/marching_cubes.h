// Discrete marching cubes: the surface of a volume.
// Source: Kenmochi, Kotani and Imiya, "Marching cubes method with connectivity", ICIP 1999, as used
// by Takai et al., "3D Video Technologies", section 2.3; the cases are our own
// (recon/cube_cases.h).
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "base/mesh.h"
#include "recon/sparse_volume.h"

namespace v3d {

/// A mesh whose vertices lie on a lattice of half voxels:
/// mesh.vertices[n] == float(origin + half_voxels[n] * voxel_m / 2), computed in double, to the
/// bit.
struct LatticeMesh {
  Mesh mesh;  ///< without colours
  std::vector<std::array<uint16_t, 3>> half_voxels;
};

/// The position of a vertex in the world, metres.
Eigen::Vector3f lattice_position(const VoxelGrid& grid, const std::array<uint16_t, 3>& half_voxels);

/// A vertex stands midway between every occupied voxel centre and its empty neighbours along the
/// axes; outside the grid everything is empty. The mesh is closed and 2-manifold whatever the
/// volume, without exception: voxels that touch along an edge are joined, voxels that touch at a
/// corner only are apart. Triangles are counter-clockwise seen from the empty side. Vertices are in
/// the order of the bricks (z, y, x) and then of axis and voxel, triangles in that of their cubes.
/// Works in the caller's TBB arena; the result depends on the volume alone.
LatticeMesh marching_cubes(const SparseVolume& volume);

}  // namespace v3d
