// Smoothing of a mesh, and the internal force of the deformation.
#pragma once

#include <vector>

#include "base/geometry/mesh.h"
#include "recon/mesh/neighbours.h"

namespace v3d {

/// Taubin smoothing: `passes` steps towards the mean of the neighbours. After each, a slightly
/// smaller step back prevents shrinking. `work` keeps its memory. Works in the caller's TBB arena;
/// independent of thread count. Source: Taubin, A signal processing approach to fair surface
/// design, SIGGRAPH 1995.
void smooth_surface(const Neighbours& neighbours, int passes,
                    std::vector<Eigen::Vector3f>& vertices, std::vector<Eigen::Vector3f>& work);

/// Replaces each unit normal by the normalised sum of itself and its neighbours, `passes` times.
void smooth_normals(const Neighbours& neighbours, int passes, std::vector<Eigen::Vector3f>& normals,
                    std::vector<Eigen::Vector3f>& work);

/// Vector from a vertex to the mean of its neighbours. Source: equation (2) of the paper.
Eigen::Vector3f internal_force(const Neighbours& neighbours,
                               const std::vector<Eigen::Vector3f>& vertices, size_t vertex);

}  // namespace v3d
