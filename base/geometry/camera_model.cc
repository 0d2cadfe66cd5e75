#include "base/geometry/camera_model.h"

#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <limits>

namespace v3d {
namespace {

enum { kK1, kK2, kP1, kP2, kK3, kK4, kK5, kK6, kS1, kS2, kS3, kS4, kTauX, kTauY };

/// Numerator and denominator of the radial factor, and their derivatives by s = r^2.
struct Radial {
  double numerator, numerator_slope, denominator, denominator_slope;
};

Radial radial_at(const Distortion& d, double s) {
  return {1 + s * (d[kK1] + s * (d[kK2] + s * d[kK3])), d[kK1] + s * (2 * d[kK2] + s * 3 * d[kK3]),
          1 + s * (d[kK4] + s * (d[kK5] + s * d[kK6])), d[kK4] + s * (2 * d[kK5] + s * 3 * d[kK6])};
}

/// True when the distorted radius grows with the radius: d/dr [r R(r^2)] = R + 2 s R' > 0.
bool grows_at(const Distortion& d, double s) {
  const Radial q = radial_at(d, s);
  const double slope =
      q.numerator * q.denominator +
      2 * s * (q.numerator_slope * q.denominator - q.numerator * q.denominator_slope);
  return q.denominator > 0 && slope > 0;
}

/// The squared radius up to which the radial polynomial grows. The search ends at radius 40 (88.5
/// degrees off the axis): no image of this model reaches so far.
double find_max_radius2(const Distortion& d) {
  constexpr double kMaxRadius = 40;
  constexpr double kStep = 0.004;
  double good = 0;
  for (double r = kStep; r <= kMaxRadius; r += kStep) {
    if (grows_at(d, r * r)) {
      good = r;
      continue;
    }
    double bad = r;
    for (int i = 0; i < 40; ++i) {
      const double middle = 0.5 * (good + bad);
      (grows_at(d, middle * middle) ? good : bad) = middle;
    }
    return good * good;
  }
  return std::numeric_limits<double>::infinity();
}

/// The homography of a sensor tilted by tau_x, tau_y (OpenCV: computeTiltProjectionMatrix).
Eigen::Matrix3d tilt_matrix(double tau_x, double tau_y) {
  const Eigen::Matrix3d tilt_rotation = (Eigen::AngleAxisd(-tau_y, Eigen::Vector3d::UnitY()) *
                                         Eigen::AngleAxisd(-tau_x, Eigen::Vector3d::UnitX()))
                                            .toRotationMatrix();
  Eigen::Matrix3d project;
  project << tilt_rotation(2, 2), 0, -tilt_rotation(0, 2), 0, tilt_rotation(2, 2),
      -tilt_rotation(1, 2), 0, 0, 1;
  return project * tilt_rotation;
}

}  // namespace

CameraModel::CameraModel(ImageSize size, const Eigen::Matrix3d& matrix,
                         const Distortion& distortion, const RigidTransform& cam_from_world)
    : size_(size),
      matrix_(matrix),
      distortion_(distortion),
      cam_from_world_(cam_from_world),
      tilt_(tilt_matrix(distortion[kTauX], distortion[kTauY])),
      has_distortion_(
          std::any_of(distortion.begin(), distortion.end(), [](double k) { return k != 0; })),
      max_radius2_(has_distortion_ ? find_max_radius2(distortion)
                                   : std::numeric_limits<double>::infinity()) {}

Eigen::Vector2d CameraModel::distort(const Eigen::Vector2d& normalised) const {
  if (!has_distortion_) {
    return normalised;
  }
  const Distortion& d = distortion_;
  const double x = normalised.x();
  const double y = normalised.y();
  const double s = x * x + y * y;
  const Radial q = radial_at(d, s);
  const double radial = q.numerator / q.denominator;
  const Eigen::Vector3d untilted(
      x * radial + 2 * d[kP1] * x * y + d[kP2] * (s + 2 * x * x) + s * (d[kS1] + s * d[kS2]),
      y * radial + d[kP1] * (s + 2 * y * y) + 2 * d[kP2] * x * y + s * (d[kS3] + s * d[kS4]), 1);
  return (tilt_ * untilted).hnormalized();
}

std::optional<Eigen::Vector2d> CameraModel::undistort(const Eigen::Vector2d& distorted) const {
  constexpr double kTolerance = 1e-12;
  constexpr double kDelta = 1e-7;
  Eigen::Vector2d x = Eigen::Vector2d::Zero();
  Eigen::Vector2d error = distort(x) - distorted;
  for (int iteration = 0; iteration < 60; ++iteration) {
    if (error.norm() < kTolerance) {
      return x.squaredNorm() <= max_radius2_ ? std::optional(x) : std::nullopt;
    }
    Eigen::Matrix2d jacobian;
    for (int i = 0; i < 2; ++i) {
      const Eigen::Vector2d step = Eigen::Vector2d::Unit(i) * kDelta;
      jacobian.col(i) = (distort(x + step) - distort(x - step)) / (2 * kDelta);
    }
    const Eigen::Vector2d step = jacobian.inverse() * error;
    // Damped Newton step: stays within the fold and reduces the error.
    double length = 1;
    for (; length > 1e-3; length *= 0.5) {
      const Eigen::Vector2d next = x - length * step;
      const Eigen::Vector2d next_error = distort(next) - distorted;
      if (next.squaredNorm() <= max_radius2_ && next_error.norm() < error.norm()) {
        x = next;
        error = next_error;
        break;
      }
    }
    if (!(length > 1e-3)) {
      // Rounding prevents a smaller error; accept the result only when it is close to the
      // tolerance.
      return error.norm() < 1e3 * kTolerance ? std::optional(x) : std::nullopt;
    }
  }
  return std::nullopt;
}

std::optional<Eigen::Vector2d> CameraModel::project(const Eigen::Vector3d& world) const {
  const Eigen::Vector3d p = cam_from_world_ * world;
  if (!(p.z() > 0)) {
    return std::nullopt;
  }
  const Eigen::Vector2d normalised = p.head<2>() / p.z();
  if (!(normalised.squaredNorm() <= max_radius2_)) {
    return std::nullopt;
  }
  return (matrix_ * distort(normalised).homogeneous()).head<2>();
}

std::optional<Eigen::Vector3d> CameraModel::ray(const Eigen::Vector2d& pixel) const {
  const double y = (pixel.y() - matrix_(1, 2)) / matrix_(1, 1);
  const double x = (pixel.x() - matrix_(0, 2) - matrix_(0, 1) * y) / matrix_(0, 0);
  const auto normalised = undistort({x, y});
  if (!normalised) {
    return std::nullopt;
  }
  return cam_from_world_.rotation.transpose() * normalised->homogeneous().normalized();
}

CameraModel CameraModel::reduced(int factor) const {
  // Pixel centres are integers, so the first reduced pixel's centre lies at (factor - 1) / 2.
  Eigen::Matrix3d k = matrix_;
  const double shift = 0.5 * (factor - 1);
  k(0, 2) -= shift;
  k(1, 2) -= shift;
  k.topRows<2>() /= factor;
  CameraModel small = *this;
  small.size_ = {(size_.width + factor - 1) / factor, (size_.height + factor - 1) / factor};
  small.matrix_ = k;
  return small;
}

int used_distortions(const Distortion& distortion) {
  for (const int count : {0, 4, 5, 8, 12}) {
    const auto is_zero = [](double k) { return k == 0; };
    if (std::all_of(distortion.begin() + count, distortion.end(), is_zero)) return count;
  }
  return static_cast<int>(distortion.size());
}

int find_camera(const Rig& rig, std::string_view name) {
  const auto found =
      std::find_if(rig.begin(), rig.end(), [&](const RigCamera& c) { return c.name == name; });
  return found == rig.end() ? -1 : static_cast<int>(found - rig.begin());
}

std::vector<CameraModel> models_of(const Rig& rig) {
  std::vector<CameraModel> models;
  models.reserve(rig.size());
  for (const RigCamera& camera : rig) models.push_back(camera.model);
  return models;
}

}  // namespace v3d
