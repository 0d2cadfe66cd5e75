// Observations of a board that is carried through a simulated studio.
#pragma once

#include <vector>

#include "calib/boards/board.h"
#include "sim/cameras/board_walk.h"

namespace v3d::calib {

/// The observations of all cameras of `rig`; the instant is the number of the board position.
std::vector<CameraObservations> observe_board_walk(const Board& board, const Rig& rig,
                                                   const sim::BoardWalkOptions& options);

/// Errors of each camera's pose, after the rigid alignment of the two worlds.
struct PoseErrors {
  std::vector<double> distance_mm;
  std::vector<double> angle_deg;
};
PoseErrors pose_errors(const Rig& found, const Rig& truth);

}  // namespace v3d::calib
