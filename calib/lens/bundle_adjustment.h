// Bundle adjustment of lenses, camera poses and board poses. The adapter of the Ceres solver.
#pragma once

#include <span>
#include <string>
#include <vector>

#include "base/geometry/camera_model.h"
#include "calib/boards/board.h"

namespace v3d::calib {

/// One corner of one board, observed by one camera.
struct CornerObservation {
  int camera = 0;
  int board = 0;  ///< index into Bundle::world_from_board
  int corner = 0;
  Eigen::Vector2d pixel = Eigen::Vector2d::Zero();
};

/// All parameters and observations. The world frame is arbitrary; fixed cameras define it.
struct Bundle {
  Board board;
  std::vector<CameraModel> cameras;
  std::vector<RigidTransform> world_from_board;
  std::vector<CornerObservation> observations;
};

struct BundleOptions {
  /// By camera, the number of free distortion coefficients in OpenCV's order: 4, 5 or 8, together
  /// with the camera matrix (skew, thin prism and tilt are constant); 0: the whole lens is
  /// constant. Empty: all lenses are constant.
  std::vector<int> coefficients{};
  /// Cameras whose poses are constant. At least one is needed to fix the gauge.
  std::vector<int> fixed_cameras = {0};
  /// Threshold of Huber's loss: larger residuals of a corner count linearly.
  double robust_px = 1.0;
  int iterations = 60;
  int threads = 2;
};

struct BundleSummary {
  bool converged = false;
  int iterations = 0;
  std::string message{};  ///< from the solver, where it did not converge
};

/// Minimises the reprojection errors of all corners, starting from the values in `bundle`.
///
/// Levenberg-Marquardt with a sparse Schur complement that eliminates the boards first. A weak
/// prior keeps free lenses plausible in image regions without corners. Requires that every camera
/// and board has observations, and that the initial values put all corners in front of the cameras.
/// Deterministic, except for rounding that depends on the number of threads.
BundleSummary adjust(Bundle& bundle, const BundleOptions& options);

/// Reprojection residuals (observed minus projected, pixels) by observation; 1e6 for a corner that
/// cannot be projected.
std::vector<Eigen::Vector2d> residuals(const Bundle& bundle);

// Standard deviation of the focal length of a fitted lens.

/// An observation of the board, with the fitted pose of the board in the camera frame.
struct PosedObservation {
  const BoardObservation* observation = nullptr;
  RigidTransform cam_from_board;
};

/// The standard deviation (1 sigma) of fx, pixels, of a lens that adjust() has fitted to `views`.
///
/// It is computed from the normal equations of the adjustment, with the board poses eliminated, and
/// includes the distance to the minimum where the adjustment ended before it. The standard
/// deviation of a corner is that of the residuals; the lens prior counts with its own. Errors that
/// all corners share, such as a bent board, are not included. Boards of one tilt do not determine
/// the focal length: the deviation is then as large as the focal length, or larger. `coefficients`:
/// number of fitted distortion coefficients, 4, 5 or 8. `robust_px`: that of the adjustment.
/// Infinite where a corner is behind the camera. Pure. Source: Triggs et al. 2000, "Bundle
/// Adjustment - A Modern Synthesis", sections 6.1 and 9.
double focal_deviation_px(const CameraModel& lens, int coefficients, const Board& board,
                          std::span<const PosedObservation> views, double robust_px);

}  // namespace v3d::calib
