// How finely a mesh is divided.
#pragma once

#include "base/mesh.h"

namespace v3d {

/// The mean length of the triangles' first edges, metres: near enough to the voxel that a mesh of
/// marching cubes was made of. 0 without triangles.
double mean_edge(const Mesh& mesh);

/// The same surface, no edge longer than `most_m`: longer ones are halved until they are short, the
/// triangles on both sides alike, so that no cracks open. The vertices of `mesh` keep their places
/// and stand first; colours are left out. Requires most_m > 0.
Mesh with_short_edges(const Mesh& mesh, double max_m);

}  // namespace v3d
