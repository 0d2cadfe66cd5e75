#include "recon/skeleton/joint_rotations.h"

#include <Eigen/Geometry>
#include <tuple>

namespace v3d::recon {
namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;

/// z along `up`, y as near to `left` as possible.
Matrix3d frame(const Vector3d& up, const Vector3d& left) {
  Matrix3d result;
  const Vector3d z = up.normalized();
  Vector3d y = left - left.dot(z) * z;
  if (y.norm() < 1e-6) y = z.unitOrthogonal();
  y.normalize();
  result << y.cross(z), y, z;
  return result;
}

}  // namespace

std::array<Matrix3d, kJoints> joint_rotations(const JointPositions& joints) {
  std::array<Matrix3d, kJoints> result;
  const Vector3d spine = joints[kNeck] - joints[kPelvis];
  result[kPelvis] = frame(spine, joints[kLeftHip] - joints[kRightHip]);
  const Vector3d across = joints[kLeftShoulder] - joints[kRightShoulder];
  result[kNeck] = frame(spine, across);
  result[kHead] = frame(joints[kHead] - joints[kNeck], across);
  for (const auto& [root, middle, tip, trunk] :
       {std::tuple{kLeftShoulder, kLeftElbow, kLeftWrist, kNeck},
        std::tuple{kRightShoulder, kRightElbow, kRightWrist, kNeck},
        std::tuple{kLeftHip, kLeftKnee, kLeftAnkle, kPelvis},
        std::tuple{kRightHip, kRightKnee, kRightAnkle, kPelvis}}) {
    const Vector3d upper = joints[root] - joints[middle], lower = joints[middle] - joints[tip];
    // The hinge of an elbow bends forward, that of a knee backward: y to the left in both.
    Vector3d hinge = trunk == kNeck ? lower.cross(upper) : upper.cross(lower);
    hinge = hinge.norm() > 0.02 * upper.norm() * lower.norm() ? Vector3d(hinge.normalized())
                                                              : Vector3d(Vector3d::Zero());
    const Vector3d left = hinge + 0.05 * result[trunk].col(1);
    result[root] = frame(upper, left);
    result[middle] = result[tip] = frame(lower, left);
  }
  result[kPropBase] = frame(joints[kPropTip] - joints[kPropBase], across);
  result[kPropTip] = result[kPropBase];
  return result;
}

}  // namespace v3d::recon
