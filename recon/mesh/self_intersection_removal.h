// Removes self-intersections that a deformation added to a mesh.
#pragma once

#include <optional>

#include "base/geometry/mesh.h"
#include "recon/mesh/neighbours.h"
#include "recon/mesh/vertex_lattice.h"

namespace v3d {

/// Smooths the surface around every self-intersection, which removes folds and spikes. Vertices of
/// the remaining self-intersections move back towards `start`: by half in each pass, in growing
/// regions. In the last step they move back completely, in regions that grow until nothing
/// intersects.
///
/// All vertices end on `lattice`, if there is one; `start` must lie on it. Returns the number of
/// remaining self-intersections: 0 unless `start` intersects itself. Works in the caller's TBB
/// arena; independent of thread count.
size_t remove_self_intersections(const Neighbours& neighbours,
                                 const std::vector<Eigen::Vector3f>& start,
                                 const std::optional<VertexLattice>& lattice, Mesh& mesh);

}  // namespace v3d
