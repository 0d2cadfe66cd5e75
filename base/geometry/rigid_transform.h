// Rigid transforms and boxes, with the conventions of the whole project.
// World frame: metres, right-handed, z up. Camera frame: OpenCV's, x right, y down, z forward. A
// transform is named target_from_source: x_cam = cam_from_world * x_world.
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>

namespace v3d {

/// A rotation followed by a translation.
struct RigidTransform {
  Eigen::Matrix3d rotation = Eigen::Matrix3d::Identity();
  Eigen::Vector3d translation = Eigen::Vector3d::Zero();

  /// `rotation_vector`: axis times angle in radians (Rodrigues).
  static RigidTransform from_rodrigues(const Eigen::Vector3d& rotation_vector,
                                       const Eigen::Vector3d& translation);
  Eigen::Vector3d rodrigues() const;

  Eigen::Vector3d operator*(const Eigen::Vector3d& p) const { return rotation * p + translation; }
  RigidTransform operator*(const RigidTransform& inner) const {
    return {rotation * inner.rotation, rotation * inner.translation + translation};
  }
  RigidTransform inverse() const {
    return {rotation.transpose(), -(rotation.transpose() * translation)};
  }
};

/// cam_from_world of a camera at `eye` (world, metres) that looks at `target`, with the image
/// upright relative to world z.
RigidTransform look_at(const Eigen::Vector3d& eye, const Eigen::Vector3d& target);

}  // namespace v3d
