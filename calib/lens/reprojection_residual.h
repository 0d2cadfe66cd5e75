// Reprojection residuals of one board observation, with analytic derivatives by lens, camera pose
// and board pose.
#pragma once

#include <Eigen/Core>
#include <array>
#include <vector>

#include "base/geometry/camera_model.h"

namespace v3d::calib {

/// Size of a pose block: rotation vector (radians), translation (metres).
inline constexpr int kPoseSize = 6;
/// Largest size of a lens block: fx fy cx cy, then the free ones of k1 k2 p1 p2 k3 k4 k5 k6.
inline constexpr int kMaxLensSize = 12;

/// The residuals of all corners that one camera observed of one board at one instant.
///
/// The residuals of all corners depend on at most 18 numbers: the lens and the pose of the board in
/// the camera. So they are condensed to rows() residuals with the same gradient and the same
/// Gauss-Newton matrix. A Gauss-Newton solver then takes the same steps with a fifth of the rows,
/// for a board of 54 corners.
class ReprojectionResidual {
 public:
  /// `coefficients`: number of free distortion coefficients, 4, 5 or 8 together with the camera
  /// matrix; 0: the lens is constant. Constant values are those of `camera`. `robust_px`: threshold
  /// of Huber's loss, applied to each corner by itself (Huber 1964).
  ReprojectionResidual(const CameraModel& camera, int coefficients, double robust_px);

  /// `corner`: board frame, metres. `pixel`: where the camera observed it.
  void add(const Eigen::Vector3d& corner, const Eigen::Vector2d& pixel);

  int lens_size() const { return lens_size_; }  ///< size of the lens block; 0: there is none
  int rows() const { return kPoseSize + lens_size_ + 2; }

  /// `blocks`: cam_from_world, world_from_board and, where it is free, the lens. `residuals`:
  /// rows() numbers; their squares add up to the losses of all corners (pixels squared).
  /// `jacobians`: null, or by block null or rows() x block size, row-major.
  /// Returns false where a corner is behind the camera.
  bool evaluate(const double* const* blocks, double* residuals, double** jacobians) const;

 private:
  struct Corner {
    Eigen::Vector3d on_board;
    Eigen::Vector2d pixel;
  };
  struct BoardInCamera;
  class Lens;
  template <int kLens>
  class Condenser;

  template <int kLens>
  bool condense(const Lens& lens, const BoardInCamera& board, double* residuals,
                double** jacobians) const;
  bool sum_losses(const Lens& lens, const BoardInCamera& board, double* residuals) const;

  std::array<double, 16> known_lens_;  ///< fx fy cx cy and the 12 coefficients from k1 to s4
  double skew_;
  Eigen::Matrix3d tilt_;
  int lens_size_;
  double robust_px_;
  std::vector<Corner> corners_;
};

}  // namespace v3d::calib
