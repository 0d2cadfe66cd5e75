// What hides a surface from a camera, told by points instead of triangles.
#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <limits>
#include <vector>

#include "base/mesh.h"

namespace v3d {

/// The vertices of the mesh, and points inside its larger triangles: no place on the surface is
/// farther than `radius_m` from a point. Where the triangles are no larger than the radius (those
/// of a volume whose voxels have edges of 1.41 * radius_m) these are the vertices alone; a triangle
/// n times as large adds about n^2 / 2 points.
std::vector<Eigen::Vector3f> occluding_points(const Mesh& mesh, double radius_m);

/// The coordinates of points or vectors, one array each. The arrays are padded with NaN, which no
/// camera sees, to a whole number of kBlock.
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
