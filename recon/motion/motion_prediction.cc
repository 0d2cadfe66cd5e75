#include "recon/motion/motion_prediction.h"

#include <Eigen/Geometry>

#include "base/core/error.h"

namespace v3d::recon {
namespace {

using Eigen::Matrix3d;

/// `now`, turned `ratio` times as far as from `before` to `now`.
Matrix3d turned_on(const Matrix3d& before, const Matrix3d& now, double ratio) {
  if (ratio == 1) return now * before.transpose() * now;
  const Matrix3d once = now * before.transpose();
  const Eigen::AngleAxisd turn(once);
  return Eigen::AngleAxisd(ratio * turn.angle(), turn.axis()).toRotationMatrix() * now;
}

}  // namespace

std::vector<NodeMotion> with_same_speed(std::span<const NodeMotion> before,
                                        std::span<const NodeMotion> now, double ratio) {
  V3D_CHECK(before.size() == now.size() && ratio > 0);
  std::vector<NodeMotion> next(now.size());
  for (size_t n = 0; n < now.size(); ++n) {
    const Matrix3d turned = turned_on(before[n].rotation, now[n].rotation, ratio);
    // Without this, rounding errors double with each pulse that is only predicted.
    next[n].rotation = Eigen::Quaterniond(turned).normalized().toRotationMatrix();
    next[n].position = (1 + ratio) * now[n].position - ratio * before[n].position;
  }
  return next;
}

}  // namespace v3d::recon
