#include "v3dctl/reconstruct/reconstruction_bounds.h"

#include <Eigen/Dense>
#include <algorithm>
#include <limits>
#include <vector>

#include "base/core/error.h"
#include "base/core/statistics.h"

namespace v3d::ctl {
namespace {

constexpr int kSamples = 64;  // along each axis

// Least squares: solves sum over cameras of (I - d d^T)(p - c) = 0. A small weight of the cameras'
// mean position keeps the system regular for parallel axes.
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

int cameras_seeing(const Rig& rig, const Eigen::Vector3d& point) {
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

}  // namespace

int default_min_views(int cameras) { return std::clamp(cameras - 1, 1, 4); }

Box observed_bounds(const Rig& rig, int min_cameras) {
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
        if (offset.norm() > radius || cameras_seeing(rig, focus + offset) < min_cameras) continue;
        seen.min = seen.min.cwiseMin(focus + offset - Eigen::Vector3d::Constant(0.5 * step));
        seen.max = seen.max.cwiseMax(focus + offset + Eigen::Vector3d::Constant(0.5 * step));
      }
    }
  }
  if (!(seen.min.array() < seen.max.array()).all()) {
    throw InputError("no point is seen by " + std::to_string(min_cameras) +
                     " cameras; expected --bounds, or a smaller --min-views");
  }
  return seen;
}

Box default_bounds(const Rig& rig, int min_views) {
  const int cameras = static_cast<int>(rig.size());
  return observed_bounds(rig, std::max(min_views, (cameras + 1) / 2));
}

}  // namespace v3d::ctl
