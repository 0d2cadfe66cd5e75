// Camera model of OpenCV's calib3d: pinhole with skew and every distortion vector of OpenCV.
// Source: OpenCV 4.6 "Camera Calibration and 3D Reconstruction", pinhole model with k1..k6
// (rational), p1 p2 (tangential), s1..s4 (thin prism), tau_x tau_y (tilted sensor).
#pragma once

#include <Eigen/Core>
#include <array>
#include <optional>
#include <string>
#include <vector>

#include "base/geometry/rigid_transform.h"
#include "base/image/colour.h"
#include "base/image/image.h"

namespace v3d {

/// Distortion coefficients in OpenCV's order: k1 k2 p1 p2 k3 k4 k5 k6 s1 s2 s3 s4 tau_x tau_y.
/// Missing coefficients are 0.
using Distortion = std::array<double, 14>;
/// The shortest of OpenCV's lengths (0, 4, 5, 8, 12 or 14) that holds all coefficients other than
/// 0.
int used_distortions(const Distortion& distortion);

/// A calibrated camera: projects world points to pixels and pixels to rays.
///
/// Pixel coordinates are those of OpenCV: the centre of the first pixel is (0, 0). A point belongs
/// to the pixel with the nearest centre (floor(u + 0.5)). A point is inside the image when that
/// pixel exists.
/// Immutable after construction; safe to use from any thread.
class CameraModel {
 public:
  CameraModel() = default;
  /// `matrix`: [fx skew cx; 0 fy cy; 0 0 1] in pixels; fx and fy are positive.
  CameraModel(ImageSize size, const Eigen::Matrix3d& matrix, const Distortion& distortion,
              const RigidTransform& cam_from_world);

  ImageSize size() const { return size_; }
  const Eigen::Matrix3d& matrix() const { return matrix_; }
  const Distortion& distortion() const { return distortion_; }
  const RigidTransform& cam_from_world() const { return cam_from_world_; }
  bool has_distortion() const { return has_distortion_; }
  /// Homography of the tilted sensor, applied after the polynomial (identity without tau).
  const Eigen::Matrix3d& tilt() const { return tilt_; }

  /// The optical centre in world coordinates, metres.
  Eigen::Vector3d center() const { return cam_from_world_.inverse().translation; }
  /// Unit vector along the optical axis into the scene, in world coordinates (the paper's V_c).
  Eigen::Vector3d viewing_direction() const { return cam_from_world_.rotation.row(2).transpose(); }

  /// Largest squared radius at which the model is valid (normalised, undistorted x^2 + y^2);
  /// infinity for a polynomial that never folds.
  /// Polynomials fold back far outside the image: a lens with barrel distortion would project
  /// points beside or behind the camera into the image. The camera projects no point beyond this
  /// radius.
  double max_radius2() const { return max_radius2_; }

  /// Converts normalised undistorted coordinates (x/z, y/z) to normalised distorted coordinates.
  Eigen::Vector2d distort(const Eigen::Vector2d& normalised) const;
  /// Inverse of distort() by Newton's method to 1e-12. Empty when it does not converge within
  /// max_radius2().
  std::optional<Eigen::Vector2d> undistort(const Eigen::Vector2d& distorted) const;

  /// Pixel coordinates of a world point, also outside the image. Empty behind the camera (z <= 0)
  /// and beyond max_radius2().
  std::optional<Eigen::Vector2d> project(const Eigen::Vector3d& world) const;
  /// Unit direction, in world coordinates, of the ray through a pixel. Empty where undistort() is.
  std::optional<Eigen::Vector3d> ray(const Eigen::Vector2d& pixel) const;

  bool inside_image(const Eigen::Vector2d& pixel) const {
    return pixel.x() >= -0.5 && pixel.y() >= -0.5 && pixel.x() < size_.width - 0.5 &&
           pixel.y() < size_.height - 0.5;
  }

  /// The camera of images reduced by an integer factor (for depth buffers and previews).
  CameraModel reduced(int factor) const;

 private:
  ImageSize size_;
  Eigen::Matrix3d matrix_ = Eigen::Matrix3d::Identity();
  Distortion distortion_{};
  RigidTransform cam_from_world_;
  Eigen::Matrix3d tilt_ = Eigen::Matrix3d::Identity();
  bool has_distortion_ = false;
  double max_radius2_ = 0;
};

/// A calibrated camera of the studio.
struct RigCamera {
  std::string name;
  CameraModel model;
  ColourResponse colour{};
};
using Rig = std::vector<RigCamera>;

/// Index of the camera with this name, or -1.
int find_camera(const Rig& rig, std::string_view name);

/// The models of all cameras, in the order of the rig.
std::vector<CameraModel> models_of(const Rig& rig);

}  // namespace v3d
