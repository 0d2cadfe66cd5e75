// Refinement of camera poses from the silhouettes of a take, without a board.
#pragma once

#include <Eigen/Core>
#include <cmath>
#include <span>
#include <vector>

#include "base/geometry/camera_model.h"
#include "base/image/mask.h"

namespace v3d::calib {

// Epipolar tangents: epipolar planes of two cameras that touch a silhouette, at frontier points.
//
// An epipolar plane that touches an object touches its silhouettes in both cameras. So the
// outermost epipolar planes of a silhouette are the same in both cameras. Where they differ, the
// relative pose of the cameras is wrong. Source: Sinha, Pollefeys, McMillan, "Camera Network
// Calibration from Dynamic Silhouettes", 2004.

/// The convex hull of a silhouette, in undistorted, normalised image coordinates (z = 1, camera
/// frame).
struct Outline {
  std::vector<Eigen::Vector3d> rays;  ///< vertices of the hull, counter-clockwise
  std::vector<bool> at_border;        ///< by ray: at the image border, so the true hull is unknown
  Eigen::Vector3d middle{0, 0, 1};    ///< ray to the centroid of the outline pixels

  bool empty() const { return rays.size() < 3; }
};
Outline outline_of(const Mask& mask, const CameraModel& camera);

/// An outermost epipolar plane of two cameras.
struct EpipolarTangent {
  int a = 0, b = 0;              ///< cameras, a < b
  Eigen::Vector3d ray_a, ray_b;  ///< to the points of contact, in the camera frames
  /// A point in the scene (world frame, metres). It lies on the side of the baseline
  /// from which the angles of planes are counted.
  Eigen::Vector3d scene_point;
  /// Derivative of the plane's angle by the width of the silhouette, radians per pixel.
  double rad_per_px_a = 0, rad_per_px_b = 0;

  /// Converts the angle between the two planes to pixels, for equal errors of both outlines.
  double px_per_radian() const { return std::sqrt(2.0) / std::hypot(rad_per_px_a, rad_per_px_b); }
};

/// The signed angle between the planes of the tangent in both cameras, radians; 0 where they agree.
/// `rotation` and `centre`: the rotation of cam_from_world and the centre of each camera (world).
template <class T>
T angle_between(const EpipolarTangent& tangent, const Eigen::Matrix<T, 3, 3>& rotation_a,
                const Eigen::Matrix<T, 3, 1>& centre_a, const Eigen::Matrix<T, 3, 3>& rotation_b,
                const Eigen::Matrix<T, 3, 1>& centre_b) {
  using Vector = Eigen::Matrix<T, 3, 1>;
  const Vector axis = (centre_b - centre_a).normalized();
  const Vector out = tangent.scene_point.cast<T>() - centre_a;
  const Vector v = (out - axis * axis.dot(out)).normalized();
  const Vector u = axis.cross(v);
  const Vector ray_a = rotation_a.transpose() * tangent.ray_a.cast<T>();
  const Vector ray_b = rotation_b.transpose() * tangent.ray_b.cast<T>();
  using std::atan2;
  return atan2(u.dot(ray_a), v.dot(ray_a)) - atan2(u.dot(ray_b), v.dot(ray_b));
}
double angle_between(const EpipolarTangent& tangent, const CameraModel& a, const CameraModel& b);

/// All tangents of one instant: two for each pair of cameras, except at image borders and where a
/// camera looks along the baseline. `outlines`: by camera; empty where a camera has no silhouette.
std::vector<EpipolarTangent> epipolar_tangents(const std::vector<CameraModel>& cameras,
                                               std::span<const Outline> outlines);

/// The silhouettes of all cameras at one instant; null where a camera has none.
using SilhouetteSet = std::vector<const Mask*>;

struct RefineOptions {
  bool focal_lengths = false;  ///< also refine the focal lengths
  /// Standard deviation of the calibration error, pixels. It is the prior of all parameters.
  double expected_px = 3;
  int threads = 2;
};

/// Epipolar tangency errors of one camera, over the held-out instants.
struct RefinedCamera {
  int tangents = 0;  ///< number of compared epipolar tangents
  /// Median distance between the tangent planes of this and another camera, pixels. After the
  /// refinement, a tangent that no longer exists counts as 1000 pixels.
  double before_px = 0;
  double after_px = 0;
  double moved_px = 0;  ///< image shift of the scene centre
};

struct RefineResult {
  Rig rig;  ///< the refined rig where `better`, else the given one
  bool better = false;
  double before_px = 0;  ///< median over all cameras
  double after_px = 0;
  std::vector<RefinedCamera> cameras;
};

inline constexpr int kMinSilhouetteSets = 6;

/// Refines the poses of calibrated cameras by epipolar tangents.
///
/// `sets`: instants with different poses of the performer. Every third instant is held out. The rig
/// is changed only where its median error on them falls below 0.6 of the error before. Silhouettes
/// at an image border are used as far as their tangents lie inside. Position, orientation and scale
/// of the whole rig are kept, because silhouettes do not determine them.
/// Throws InputError for fewer than kMinSilhouetteSets instants, and for too few tangents.
/// Pure. Uses options.threads threads.
RefineResult refine_by_silhouettes(const Rig& rig, const std::vector<SilhouetteSet>& sets,
                                   const RefineOptions& options);

}  // namespace v3d::calib
