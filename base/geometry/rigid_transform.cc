#include "base/geometry/rigid_transform.h"

#include <Eigen/SVD>
#include <array>
#include <cmath>
#include <string>

#include "base/core/error.h"
#include "base/core/text.h"

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

Eigen::Vector3d RigidTransform::operator*(const Eigen::Vector3d& p) const {
  return rotation * p + translation;
}

RigidTransform RigidTransform::operator*(const RigidTransform& inner) const {
  return {rotation * inner.rotation, rotation * inner.translation + translation};
}

RigidTransform RigidTransform::inverse() const {
  return {rotation.transpose(), -(rotation.transpose() * translation)};
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

Box parse_bounds(std::string_view text) {
  std::array<double, 6> v{};
  std::string_view rest = text;
  bool good = true;
  for (size_t i = 0; i < v.size() && good; ++i) {
    good = consume_number(rest, v[i]);
    if (good && i + 1 < v.size()) {
      good = rest.starts_with(',');
      rest.remove_prefix(good ? 1 : 0);
    }
  }
  if (!good || !rest.empty() || v[0] >= v[3] || v[1] >= v[4] || v[2] >= v[5]) {
    throw InputError("bounds '" + std::string(text) +
                     "': expected X0,Y0,Z0,X1,Y1,Z1 in metres, with X0 < X1, Y0 < Y1 and Z0 < Z1");
  }
  return {{v[0], v[1], v[2]}, {v[3], v[4], v[5]}};
}

Eigen::Matrix3d nearest_rotation(const Eigen::Matrix3d& matrix) {
  const Eigen::JacobiSVD<Eigen::Matrix3d> svd(matrix, Eigen::ComputeFullU | Eigen::ComputeFullV);
  Eigen::Matrix3d u = svd.matrixU();
  if ((u * svd.matrixV().transpose()).determinant() < 0) u.col(2) *= -1;
  return u * svd.matrixV().transpose();
}

}  // namespace v3d
