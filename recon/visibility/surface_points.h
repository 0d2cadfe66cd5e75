// Points of a surface: coordinates laid out for SIMD, and a set of points that covers the surface.
#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <limits>
#include <vector>

#include "base/geometry/mesh.h"

namespace v3d {

/// The vertices of `mesh`, and points inside its larger triangles, so that every place of the
/// surface is within `radius_m` metres of a point.
///
/// Triangles no larger than the radius need no point: for marching cubes, voxels with edges of 1.41
/// * radius_m. A triangle n times as large adds about n^2 / 2 points.
std::vector<Eigen::Vector3f> occluding_points(const Mesh& mesh, double radius_m);

/// Coordinates of points or vectors, one array each, padded with NaN to a multiple of kBlock. NaN
/// projects to no pixel.
struct PointArrays {
  static constexpr size_t kBlock = 512;

  size_t count = 0;  ///< without the padding
  std::vector<float> x, y, z;

  PointArrays() = default;
  explicit PointArrays(const std::vector<Eigen::Vector3f>& points) : count(points.size()) {
    const size_t padded = (count + kBlock - 1) / kBlock * kBlock;
    for (const auto& [array, axis] : {std::pair{&x, 0}, {&y, 1}, {&z, 2}}) {
      array->assign(padded, std::numeric_limits<float>::quiet_NaN());
      for (size_t i = 0; i < count; ++i) {
        (*array)[i] = points[i][axis];
      }
    }
  }
  size_t blocks() const { return x.size() / kBlock; }
};

}  // namespace v3d
