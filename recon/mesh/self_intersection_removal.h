// Removes self-intersections that a deformation added to a mesh.
#pragma once

#include <optional>

#include "base/geometry/mesh.h"
#include "recon/mesh/neighbours.h"
#include "recon/mesh/vertex_lattice.h"

namespace v3d {

/// Smooths the surface around every self-intersection, which removes folds and spikes. Vertices of
/// the remaining ones move back towards `start`, where the surface had none: by half in each pass
/// and in growing regions, at last completely, in regions that grow until nothing intersects.
///
/// All vertices end on `lattice`, if there is one, on which `start` must lie. Returns the number of
/// remaining self-intersections: 0 unless `start` intersects itself. Works in the caller's TBB
/// arena; independent of thread count.
size_t remove_self_intersections(const Neighbours& neighbours,
                                 const std::vector<Eigen::Vector3f>& start,
                                 const std::optional<VertexLattice>& lattice, Mesh& mesh);

}  // namespace v3d
