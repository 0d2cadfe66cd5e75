// The board on the floor, which is small and slanted in most pictures, found with what is known of
// the cameras.
#pragma once

#include <vector>

#include "calib/boards/board_detector.h"
#include "calib/rig/pair_poses.h"
#include "calibrate/rig_boards.h"

namespace v3d::calibrate {

/// Looks for the board in a few pictures of every camera; where one camera finds it, the calibrated
/// rig tells where it must be for the others, and it is looked for there. Cameras that do not see
/// it are left out. Throws InputError for sources as find_rig_boards() does, and for cameras that
/// the rig does not have.
std::vector<calib::CameraObservations> find_floor_boards(const RigSources& sources, const Rig& rig,
                                                         const calib::BoardDetector& detector);

}  // namespace v3d::calibrate
