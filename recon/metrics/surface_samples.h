// Points spread over a mesh.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <vector>

#include "base/mesh.h"

namespace v3d {

struct SurfaceSample {
  Eigen::Vector3d position;
  Eigen::Vector3d normal;  ///< interpolated from the vertices
};

/// Evenly spread by area, the same for the same seed everywhere. Empty for a mesh without area.
std::vector<SurfaceSample> sample_surface(const Mesh& mesh, int samples, uint64_t seed);

/// Of values at the vertices, with barycentric weights.
Eigen::Vector3d interpolated(const Mesh& mesh, const std::vector<Eigen::Vector3f>& values,
                             uint32_t triangle, const Eigen::Vector3d& weights);

}  // namespace v3d
