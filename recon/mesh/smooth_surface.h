// Smoothing of a mesh by its edges alone.
#pragma once

#include <vector>

#include "base/mesh.h"
#include "recon/mesh/neighbours.h"

namespace v3d {

/// Towards the mean of the neighbours and almost as far back, so that the surface becomes smooth
/// without shrinking (Taubin, A signal processing approach to fair surface design, SIGGRAPH 1995).
/// `work` keeps its memory. Works in the caller's TBB arena, the same for any number of threads.
void smooth_surface(const Neighbours& neighbours, int passes,
                    std::vector<Eigen::Vector3f>& vertices, std::vector<Eigen::Vector3f>& work);

/// Unit normals, each the mean of its own and its neighbours', `passes` times.
void smooth_normals(const Neighbours& neighbours, int passes, std::vector<Eigen::Vector3f>& normals,
                    std::vector<Eigen::Vector3f>& work);

/// The internal force, equation (2) of the paper: from a vertex to the mean of its neighbours.
Eigen::Vector3f internal_force(const Neighbours& neighbours,
                               const std::vector<Eigen::Vector3f>& vertices, size_t vertex);

}  // namespace v3d
