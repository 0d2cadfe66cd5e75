// Search for a small, slanted board on the floor, with the calibrated rig as a prediction.
#pragma once

#include <vector>

#include "calib/boards/board_detector.h"
#include "calibrate/rig_boards.h"

namespace v3d::calibrate {

/// Searches for the board in up to five images of each camera.
///
/// Where a camera finds the board, the rig predicts its pose for the other cameras, which are then
/// searched at that pose. Cameras without the board are omitted. Throws InputError for a camera
/// that `rig` lacks or has with another image size; also throws like open_sources().
std::vector<calib::CameraObservations> find_floor_boards(const RigSources& sources, const Rig& rig,
                                                         const calib::BoardDetector& detector);

}  // namespace v3d::calibrate
