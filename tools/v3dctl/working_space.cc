#include "v3dctl/working_space.h"

#include <Eigen/Dense>
#include <algorithm>
#include <limits>
#include <vector>

#include "base/error.h"
#include "v3dctl/statistics.h"

namespace v3d::ctl {
namespace {

constexpr int kSamples = 64;  // along each axis

// Least squares: the sum over cameras of (I - d d^T)(p - c) vanishes. The small pull towards the
// cameras' mean keeps parallel axes solvable.
Eigen::Vector3d point_nearest_to_axes(const Rig& rig) {
  Eigen::Matrix3d a = Eigen::Matrix3d::Zero();
  Eigen::Vector3d b = Eigen::Vector3d::Zero();
  for (const RigCamera& camera : rig) {
    const Eigen::Vector3d d = camera.model.viewing_direction();
    const Eigen::Matrix3d across =
        Eigen::Matrix3d::Identity() - d * d.transpose() + 1e-6 * Eigen::Matrix3d::Identity();
    a += across;
    b += across * camera.model.center();
  }
  return a.ldlt().solve(b);
}

int views_of(const Rig& rig, const Eigen::Vector3d& point) {
  return static_cast<int>(std::count_if(rig.begin(), rig.end(), [&](const RigCamera& camera) {
    const auto pixel = camera.model.project(point);
    return pixel && camera.model.inside_image(*pixel);
  }));
}

double median_distance(const Rig& rig, const Eigen::Vector3d& point) {
  std::vector<double> distances;
  for (const RigCamera& camera : rig) distances.push_back((camera.model.center() - point).norm());
  return median(distances);
}

// The slab test: where the ray is between both planes of every axis. A direction of 0 gives
// infinities (or NaN on a plane itself, which min and max pass over) that do right.
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

Box common_view(const Rig& rig, int views) {
  const Eigen::Vector3d focus = point_nearest_to_axes(rig);
  const double radius = median_distance(rig, focus);
  const double step = 2 * radius / kSamples;
  Box seen{Eigen::Vector3d::Constant(std::numeric_limits<double>::infinity()),
           Eigen::Vector3d::Constant(-std::numeric_limits<double>::infinity())};
  for (int k = 0; k < kSamples; ++k) {
    for (int j = 0; j < kSamples; ++j) {
      for (int i = 0; i < kSamples; ++i) {
        const Eigen::Vector3d offset =
            step * (Eigen::Vector3d(i, j, k) + Eigen::Vector3d::Constant(0.5 - 0.5 * kSamples));
        if (offset.norm() > radius || views_of(rig, focus + offset) < views) continue;
        seen.min = seen.min.cwiseMin(focus + offset - Eigen::Vector3d::Constant(0.5 * step));
        seen.max = seen.max.cwiseMax(focus + offset + Eigen::Vector3d::Constant(0.5 * step));
      }
    }
  }
  if (!(seen.min.array() < seen.max.array()).all()) {
    throw InputError("no part of the space is seen by " + std::to_string(views) +
                     " cameras: give --bounds, or a smaller --min-views");
  }
  return seen;
}

Mask view_of(const Box& box, const CameraModel& camera) {
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

}  // namespace v3d::ctl
