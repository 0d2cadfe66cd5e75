// Random points of a surface.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <vector>

#include "base/geometry/mesh.h"

namespace v3d {

struct SurfaceSample {
  Eigen::Vector3d position;
  Eigen::Vector3d normal;  ///< interpolated from the vertices
};

/// Points distributed evenly by area; the same for the same seed on every machine. Empty for a mesh
/// without area.
std::vector<SurfaceSample> sample_surface(const Mesh& mesh, int samples, uint64_t seed);

/// Interpolates `values` of the vertices inside a triangle, with barycentric weights.
Eigen::Vector3d interpolated(const Mesh& mesh, const std::vector<Eigen::Vector3f>& values,
                             uint32_t triangle, const Eigen::Vector3d& weights);

}  // namespace v3d
