// Edge lengths of a mesh: measure and subdivide.
#pragma once

#include "base/geometry/mesh.h"

namespace v3d {

/// Mean length of the first edges of all triangles, metres; close to the voxel size for a surface
/// of marching cubes. 0 without triangles.
double mean_edge(const Mesh& mesh);

/// The same surface with no edge longer than `max_m` metres. Longer edges are halved, in both
/// triangles alike, so that no cracks appear. The vertices of `mesh` come first and do not move;
/// colours are left out. Requires max_m > 0.
Mesh with_short_edges(const Mesh& mesh, double max_m);

}  // namespace v3d
