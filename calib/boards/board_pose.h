// Where a board was, from one picture of it; and a first lens from several. First values only: what
// is good for the last digit is bundle.h. The adapter of OpenCV's pose and camera estimators.
#pragma once

#include <optional>
#include <span>
#include <vector>

#include "base/camera_model.h"
#include "calib/boards/board.h"

namespace v3d::calib {

/// A pose of the board in the camera, and how far the corners then miss (pixels, root mean square
/// of the distance).
struct BoardPose {
  RigidTransform cam_from_board;
  double rms_px = 0;
};

/// The better pose first, then the one with the board tilted the other way, where there is one: of
/// a small or distant board both fit nearly as well. Only the lens of `camera` counts, not its
/// place. Empty where no pose fits at all.
std::vector<BoardPose> board_poses(const CameraModel& camera, const Board& board,
                                   const BoardSighting& sighting);

/// The camera matrix of an undistorted lens that explains the sightings (Zhang 2000, principal
/// point in the middle). Requires at least one sighting.
Eigen::Matrix3d first_camera_matrix(const Board& board, ImageSize size,
                                    std::span<const BoardSighting* const> sightings);

/// Where the corners were seen, less where a lens like `camera`'s would see them, in pixels; 1e6
/// for a corner that it cannot see.
std::vector<Eigen::Vector2d> misses(const CameraModel& camera, const Board& board,
                                    const RigidTransform& cam_from_board,
                                    const BoardSighting& sighting);

/// Root mean square of their lengths; 0 for none.
double rms_of(std::span<const Eigen::Vector2d> misses);

/// The same lens at another place.
CameraModel placed(const CameraModel& lens, const RigidTransform& cam_from_world);

}  // namespace v3d::calib
