// Points as vector registers read them.
#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <limits>
#include <vector>

namespace v3d {

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
