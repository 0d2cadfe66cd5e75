// Prior of free lenses in the bundle adjustment.
#pragma once

#include <Eigen/Core>

#include "base/geometry/camera_model.h"

namespace v3d::calib {

/// A weak prior for lenses: square pixels, principal point near the middle, little distortion.
/// It weighs as much as one or two corners, so any board in an image region outweighs it.
///
/// Parameters: the lens block of reprojection_residual.h. A residual is kCornerPx where its
/// parameter differs from the expected one by one standard deviation of the prior.
class LensPrior {
 public:
  static constexpr double kCornerPx = 0.3;  ///< standard deviation of a detected corner

  /// `coefficients`: number of free distortion coefficients.
  LensPrior(const CameraModel& camera, int coefficients)
      : middle_x_(0.5 * (camera.size().width - 1)),
        middle_y_(0.5 * (camera.size().height - 1)),
        coefficients_(coefficients) {}

  int rows() const { return 3 + coefficients_; }

  /// A functor of Ceres; `blocks`: one lens block.
  template <class T>
  bool operator()(const T* const* blocks, T* residuals) const {
    const T* lens = blocks[0];
    residuals[0] = kPixelWeight * (lens[0] - lens[1]) / (lens[0] + lens[1]);
    residuals[1] = middle_weight() * (lens[2] - middle_x_);
    residuals[2] = middle_weight() * (lens[3] - middle_y_);
    for (int i = 0; i < coefficients_; ++i) residuals[3 + i] = kCornerPx / kStdDev[i] * lens[4 + i];
    return true;
  }

  /// Derivatives of the residuals by the lens block, rows() x (4 + coefficients).
  Eigen::MatrixXd jacobian(double fx, double fy) const {
    Eigen::MatrixXd rows_by_lens = Eigen::MatrixXd::Zero(rows(), 4 + coefficients_);
    const double sum_squared = (fx + fy) * (fx + fy);
    rows_by_lens(0, 0) = kPixelWeight * 2 * fy / sum_squared;
    rows_by_lens(0, 1) = -kPixelWeight * 2 * fx / sum_squared;
    rows_by_lens(1, 2) = rows_by_lens(2, 3) = middle_weight();
    for (int i = 0; i < coefficients_; ++i) rows_by_lens(3 + i, 4 + i) = kCornerPx / kStdDev[i];
    return rows_by_lens;
  }

 private:
  static constexpr double kPixelWeight = kCornerPx / 0.003;
  static constexpr double kStdDev[] = {0.3, 0.3, 0.002, 0.002, 0.3, 0.3, 0.3, 0.3};

  double middle_weight() const { return kCornerPx / (0.04 * middle_x_); }

  double middle_x_, middle_y_;
  int coefficients_;
};

}  // namespace v3d::calib
