// Transforms, rotations and boxes.
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <string_view>

namespace v3d {

// Rigid transforms and boxes, with the conventions of the whole project.
// World frame: metres, right-handed, z up. Camera frame: OpenCV's, x right, y down, z forward. A
// transform is named target_from_source: x_cam = cam_from_world * x_world.

/// A rotation followed by a translation.
struct RigidTransform {
  Eigen::Matrix3d rotation = Eigen::Matrix3d::Identity();
  Eigen::Vector3d translation = Eigen::Vector3d::Zero();

  /// `rotation_vector`: axis times angle in radians (Rodrigues).
  static RigidTransform from_rodrigues(const Eigen::Vector3d& rotation_vector,
                                       const Eigen::Vector3d& translation);
  Eigen::Vector3d rodrigues() const;

  Eigen::Vector3d operator*(const Eigen::Vector3d& p) const;
  RigidTransform operator*(const RigidTransform& inner) const;
  RigidTransform inverse() const;
};

/// cam_from_world of a camera at `eye` (world, metres) that looks at `target`, with the image
/// upright relative to world z.
RigidTransform look_at(const Eigen::Vector3d& eye, const Eigen::Vector3d& target);

// Axis-aligned boxes.

/// An axis-aligned box in world coordinates, metres.
struct Box {
  Eigen::Vector3d min = Eigen::Vector3d::Zero();
  Eigen::Vector3d max = Eigen::Vector3d::Zero();

  Eigen::Vector3d size() const { return max - min; }
  Eigen::Vector3d center() const { return 0.5 * (min + max); }
  bool contains(const Eigen::Vector3d& p) const {
    return (p.array() >= min.array()).all() && (p.array() <= max.array()).all();
  }
};

/// Parses "X0,Y0,Z0,X1,Y1,Z1" in metres. Throws InputError unless X0 < X1, Y0 < Y1 and Z0 < Z1.
Box parse_bounds(std::string_view text);

// The rotation nearest to a matrix.

/// The rotation nearest to a matrix in the Frobenius norm. Of the covariance of two sets of
/// directions: the rotation that brings one to the other in the least squares sense.
///
/// Source: Kabsch, A solution for the best rotation to relate two sets of vectors, Acta
/// Crystallographica A32, 1976.
Eigen::Matrix3d nearest_rotation(const Eigen::Matrix3d& matrix);

}  // namespace v3d
