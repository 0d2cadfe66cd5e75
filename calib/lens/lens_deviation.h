// Standard deviation of the focal length of a fitted lens.
#pragma once

#include <span>

#include "base/geometry/camera_model.h"
#include "calib/boards/board.h"

namespace v3d::calib {

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
