// Where planes through two cameras touch a silhouette: the frontier points.
//
// A plane that holds the centres of two cameras and touches what both see touches both of its
// silhouettes. So the outermost of these planes, on either side, is the same by both cameras, and
// where it is not, the cameras do not stand where the calibration has them.
// Source: Sinha, Pollefeys, McMillan, "Camera Network Calibration from Dynamic Silhouettes", 2004.
#pragma once

#include <Eigen/Core>
#include <cmath>
#include <span>
#include <vector>

#include "base/camera_model.h"
#include "base/mask.h"

namespace v3d::calib {

/// The outline of a silhouette as far as outermost planes can touch it: where it begins and ends in
/// every row, in the frame of the camera, z = 1 (without the lens's distortion).
struct Outline {
  std::vector<Eigen::Vector3d> rays;  ///< the corners of its convex hull, counter-clockwise
  std::vector<bool> at_border;      ///< by ray: the image ends there, and what is beyond is unknown
  Eigen::Vector3d middle{0, 0, 1};  ///< ray to the middle of the silhouette

  bool empty() const { return rays.size() < 3; }
};
Outline outline_of(const Mask& mask, const CameraModel& camera);

/// An outermost plane by two cameras.
struct Tangent {
  int a = 0, b = 0;              ///< cameras, a < b
  Eigen::Vector3d ray_a, ray_b;  ///< where it touches, in the frames of the cameras
  /// Lies on the side of the plane through both centres from which angles are counted: a place amid
  /// what they see, world.
  Eigen::Vector3d amid;
  /// By how much the angle of its plane grows where the silhouette is a pixel wider, radians.
  double wider_a = 0, wider_b = 0;

  /// Of the angle between the planes, when both outlines miss alike.
  double px_per_radian() const { return std::sqrt(2.0) / std::hypot(wider_a, wider_b); }
};

/// The signed angle between the planes of the tangent by both cameras, radians: 0 where they agree.
/// `turn` and `centre`: cam_from_world's rotation and the centre of each.
template <class T>
T angle_between(const Tangent& tangent, const Eigen::Matrix<T, 3, 3>& turn_a,
                const Eigen::Matrix<T, 3, 1>& centre_a, const Eigen::Matrix<T, 3, 3>& turn_b,
                const Eigen::Matrix<T, 3, 1>& centre_b) {
  using Vector = Eigen::Matrix<T, 3, 1>;
  const Vector axis = (centre_b - centre_a).normalized();
  const Vector out = tangent.amid.cast<T>() - centre_a;
  const Vector v = (out - axis * axis.dot(out)).normalized();
  const Vector u = axis.cross(v);
  const Vector ray_a = turn_a.transpose() * tangent.ray_a.cast<T>();
  const Vector ray_b = turn_b.transpose() * tangent.ray_b.cast<T>();
  using std::atan2;
  return atan2(u.dot(ray_a), v.dot(ray_a)) - atan2(u.dot(ray_b), v.dot(ray_b));
}
double angle_between(const Tangent& tangent, const CameraModel& a, const CameraModel& b);

/// All tangents of one instant: two for every pair of cameras, but for those that touch at an
/// image's border, and pairs of which one looks along the line between them. `outlines`: by camera;
/// empty where it sees nothing.
std::vector<Tangent> tangents_of(const std::vector<CameraModel>& cameras,
                                 std::span<const Outline> outlines);

}  // namespace v3d::calib
