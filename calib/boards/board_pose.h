// Initial estimates of board poses and of a camera matrix, from observations of a board.
// The adapter of OpenCV's pose and camera estimators. lens/bundle_adjustment.h refines the
// estimates.
#pragma once

#include <optional>
#include <span>
#include <vector>

#include "base/geometry/camera_model.h"
#include "calib/boards/board.h"

namespace v3d::calib {

/// A pose of the board in the camera frame (metres).
struct BoardPose {
  RigidTransform cam_from_board;
  double rms_px = 0;  ///< root mean square of the reprojection errors
};

/// Up to two poses of the board, the one with the smaller error first (IPPE).
///
/// A small or distant board has a second pose, tilted the other way, which fits nearly as well.
/// Only the lens of `camera` is used, not its pose. Empty where no pose fits.
std::vector<BoardPose> board_poses(const CameraModel& camera, const Board& board,
                                   const BoardObservation& observation);

/// The camera matrix of an undistorted lens with its principal point in the middle of the image.
/// Requires at least one observation. Source: Zhang 2000.
Eigen::Matrix3d initial_camera_matrix(const Board& board, ImageSize size,
                                      std::span<const BoardObservation* const> observations);

/// Reprojection residuals (observed minus projected, pixels) by corner of the observation, through
/// the lens of `camera`; 1e6 for a corner that cannot be projected.
std::vector<Eigen::Vector2d> residuals(const CameraModel& camera, const Board& board,
                                       const RigidTransform& cam_from_board,
                                       const BoardObservation& observation);

/// Root mean square of the lengths of the residuals; 0 for none.
double rms_of(std::span<const Eigen::Vector2d> residuals);

/// A camera with the lens of `lens` and the pose `cam_from_world`.
CameraModel with_pose(const CameraModel& lens, const RigidTransform& cam_from_world);

}  // namespace v3d::calib
