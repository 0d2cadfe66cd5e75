#include "recon/hull/bounds_mask.h"

#include <algorithm>
#include <limits>
#include <vector>

namespace v3d {
namespace {

/// Slab test: true when the ray is between the two planes of every axis at one distance. A
/// direction component of 0 gives infinities, which are handled correctly. It gives NaN for a ray
/// in a plane; min and max ignore NaN.
bool meets(const Eigen::Vector3d& from, const Eigen::Vector3d& direction, const Box& box) {
  double enter = 0;
  double leave = std::numeric_limits<double>::infinity();
  for (int axis = 0; axis < 3; ++axis) {
    const double a = (box.min[axis] - from[axis]) / direction[axis];
    const double b = (box.max[axis] - from[axis]) / direction[axis];
    enter = std::max(enter, std::min(a, b));
    leave = std::min(leave, std::max(a, b));
  }
  return enter <= leave;
}

}  // namespace

Mask bounds_mask(const Box& box, const CameraModel& camera) {
  constexpr int kBlock = 4;
  const ImageSize size = camera.size();
  const Eigen::Vector3d from = camera.center();
  const auto corner_sees = [&](int column, int row) {
    const auto ray = camera.ray({kBlock * column - 0.5, kBlock * row - 0.5});
    return ray && meets(from, *ray, box);
  };
  const int columns = (size.width + kBlock - 1) / kBlock;
  const int rows = (size.height + kBlock - 1) / kBlock;
  const auto corner_row = [&](int row) {
    std::vector<char> sees;
    for (int column = 0; column <= columns; ++column) sees.push_back(corner_sees(column, row));
    return sees;
  };
  Mask view(size);
  std::vector<char> above = corner_row(0);
  for (int row = 0; row < rows; ++row) {
    std::vector<char> below = corner_row(row + 1);
    for (int i = 0; i < columns; ++i) {
      if (!above[i] && !above[i + 1] && !below[i] && !below[i + 1]) continue;
      for (int y = kBlock * row; y < std::min(kBlock * (row + 1), size.height); ++y) {
        view.fill_row(y, kBlock * i, std::min(kBlock * (i + 1), size.width));
      }
    }
    above = std::move(below);
  }
  return view;
}

}  // namespace v3d
