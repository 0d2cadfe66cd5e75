// Takes back what a deformation did where it pushed the surface through itself.
#pragma once

#include <optional>

#include "base/mesh.h"
#include "recon/mesh/neighbours.h"
#include "recon/mesh/vertex_lattice.h"

namespace v3d {

/// Smooths the surface round every self-intersection: folds and spikes are gone after that. What is
/// left is moved back towards `start`, where the surface had none, half way at a time and in a
/// wider region each time; where even that does not help, all the way, in a region that grows until
/// nothing crosses.
/// All vertices end on the lattice, if there is one, which `start` must lie on.
/// Returns the number of crossings that are left: none, unless `start` crosses itself. Works in the
/// caller's TBB arena; the same for any number of threads.
size_t remove_self_intersections(const Neighbours& neighbours,
                                 const std::vector<Eigen::Vector3f>& start,
                                 const std::optional<VertexLattice>& lattice, Mesh& mesh);

}  // namespace v3d
