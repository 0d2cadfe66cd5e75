// Rigs with randomly displaced cameras, and the distance between two rigs, for tests and benchmarks
// of rig refinement.
#pragma once

#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <vector>

#include "base/geometry/camera_model.h"
#include "calib/rig/rig_alignment.h"
#include "sim/rendering/noise.h"

namespace v3d::test {

/// `rig` with every camera turned and moved at random, so that points at 3 m shift by about `px`
/// pixels. Deterministic for one `seed`.
inline Rig displaced(const Rig& rig, double px, uint64_t seed) {
  constexpr double kDistance = 3;  // to the performer, metres
  Rig result = rig;
  for (size_t c = 0; c < rig.size(); ++c) {
    const CameraModel& m = rig[c].model;
    const double radians = px / m.matrix()(0, 0);
    const auto random_vector = [&](uint64_t k) {
      const uint64_t n = 100 * c + k;
      return Eigen::Vector3d(sim::uniform(seed, n, -1.7, 1.7), sim::uniform(seed, n + 1, -1.7, 1.7),
                             sim::uniform(seed, n + 2, -1.7, 1.7));
    };
    const RigidTransform turn = RigidTransform::from_rodrigues(
        radians * random_vector(0), kDistance * radians * random_vector(5));
    result[c].model = CameraModel(m.size(), m.matrix(), m.distortion(), turn * m.cam_from_world());
  }
  return result;
}

/// Root mean square distance, in pixels, between the projections of 27 points of the performer's
/// space into the two rigs, after `rig` is aligned with `truth` by the camera centres.
inline double error_px(const Rig& rig, const Rig& truth) {
  std::vector<Eigen::Vector3d> from, to;
  for (size_t c = 0; c < rig.size(); ++c) {
    from.push_back(rig[c].model.center());
    to.push_back(truth[c].model.center());
  }
  const Rig moved = calib::transformed_rig(rig, calib::align_points(from, to, true));
  double sum = 0;
  int count = 0;
  for (size_t c = 0; c < rig.size(); ++c) {
    for (int i = 0; i < 27; ++i) {
      const int right = i % 3 - 1, ahead = i / 3 % 3 - 1, up = i / 9;
      const Eigen::Vector3d position(0.5 * right, 0.5 * ahead, 0.3 + 0.7 * up);
      const auto a = moved[c].model.project(position), b = truth[c].model.project(position);
      if (!a || !b || !truth[c].model.inside_image(*b)) continue;
      sum += (*a - *b).squaredNorm();
      ++count;
    }
  }
  return std::sqrt(sum / std::max(1, count));
}

}  // namespace v3d::test
