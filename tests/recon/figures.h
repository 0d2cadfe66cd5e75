// People made of capsules, as voxel surfaces, for tests of skeletons.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <vector>

#include "recon/volumes.h"

namespace v3d::recon::figures {

struct Capsule {
  Eigen::Vector3d a, b;
  double radius = 0;  ///< metres
};

inline double distance(const Capsule& capsule, const Eigen::Vector3d& p) {
  const Eigen::Vector3d along = capsule.b - capsule.a;
  const double t =
      std::clamp((p - capsule.a).dot(along) / std::max(along.squaredNorm(), 1e-12), 0.0, 1.0);
  return (p - capsule.a - t * along).norm();
}

/// The surface of the union at voxels of `voxel_m`.
inline Mesh surface(const std::vector<Capsule>& capsules, double voxel_m = 0.016) {
  Eigen::Vector3d low = capsules[0].a, high = low;
  for (const Capsule& capsule : capsules) {
    const Eigen::Vector3d margin = Eigen::Vector3d::Constant(capsule.radius + 2 * voxel_m);
    low = low.cwiseMin(capsule.a - margin).cwiseMin(capsule.b - margin);
    high = high.cwiseMax(capsule.a + margin).cwiseMax(capsule.b + margin);
  }
  const auto count = [&](int axis) {
    return static_cast<int>(std::ceil((high[axis] - low[axis]) / voxel_m));
  };
  const VoxelGrid grid{low, voxel_m, {count(0), count(1), count(2)}};
  return marching_cubes(make_volume(grid, [&](int i, int j, int k) {
    const Eigen::Vector3d p = low + voxel_m * Eigen::Vector3d(i, j, k);
    return std::ranges::any_of(
        capsules, [&](const Capsule& capsule) { return distance(capsule, p) < capsule.radius; });
  }));
}

/// A body of 1.75 m that stands at `at`, looks along +x, and whose arms hang from the shoulders by
/// `left` and `right` degrees: 0 is down, 90 to the side.
inline std::vector<Capsule> person(double left, double right,
                                   const Eigen::Vector3d& at = Eigen::Vector3d::Zero()) {
  std::vector<Capsule> body;
  const auto add = [&](const Eigen::Vector3d& a, const Eigen::Vector3d& b, double radius) {
    body.push_back({at + a, at + b, radius});
  };
  add({0, 0, 1.62}, {0, 0, 1.65}, 0.09);
  add({0, 0, 1.40}, {0, 0, 1.6}, 0.055);
  add({0, 0.07, 1.0}, {0, 0.09, 1.35}, 0.11);
  add({0, -0.07, 1.0}, {0, -0.09, 1.35}, 0.11);
  for (const double side : {1.0, -1.0}) {
    const double angle = (side > 0 ? left : right) * 3.14159265358979 / 180;
    const Eigen::Vector3d shoulder(0, side * 0.185, 1.40);
    const Eigen::Vector3d along(0, side * std::sin(angle), -std::cos(angle));
    add(shoulder, shoulder + 0.29 * along, 0.05);
    add(shoulder + 0.29 * along, shoulder + 0.64 * along, 0.038);
    add({0, side * 0.09, 0.93}, {0, side * 0.12, 0.50}, 0.07);
    add({0, side * 0.12, 0.50}, {0, side * 0.13, 0.08}, 0.05);
    add({-0.03, side * 0.13, 0.035}, {0.17, side * 0.15, 0.035}, 0.035);
  }
  return body;
}

}  // namespace v3d::recon::figures
