#include "base/geometry/rigid_transform.h"

#include <cmath>

namespace v3d {

RigidTransform RigidTransform::from_rodrigues(const Eigen::Vector3d& rotation_vector,
                                              const Eigen::Vector3d& translation) {
  const double angle = rotation_vector.norm();
  RigidTransform t;
  t.translation = translation;
  if (angle > 0) {
    t.rotation = Eigen::AngleAxisd(angle, rotation_vector / angle).toRotationMatrix();
  }
  return t;
}

Eigen::Vector3d RigidTransform::rodrigues() const {
  const Eigen::AngleAxisd angle_axis(rotation);
  return angle_axis.angle() * angle_axis.axis();
}

RigidTransform look_at(const Eigen::Vector3d& eye, const Eigen::Vector3d& target) {
  const Eigen::Vector3d forward = (target - eye).normalized();
  Eigen::Vector3d right = forward.cross(Eigen::Vector3d::UnitZ());
  if (right.norm() < 1e-9) {
    right = Eigen::Vector3d::UnitX();  // view along world z: any direction is upright
  }
  right.normalize();
  RigidTransform t;
  t.rotation.row(0) = right.transpose();
  t.rotation.row(1) = forward.cross(right).transpose();
  t.rotation.row(2) = forward.transpose();
  t.translation = -(t.rotation * eye);
  return t;
}

}  // namespace v3d
