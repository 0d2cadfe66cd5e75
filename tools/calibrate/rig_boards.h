// The boards that all cameras of a rig saw, from files.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "calib/board_detector.h"
#include "calib/pair_poses.h"
#include "calibrate/board_search.h"
#include "v3dctl/options.h"

namespace v3d::calibrate {

/// One kind of source: videos, images or a take.
struct RigSources {
  std::vector<ctl::CameraFile> videos;
  std::vector<ctl::CameraFile> images;  ///< patterns
  std::filesystem::path take;
  std::filesystem::path time_stamps;  ///< with videos, or empty: frame n is instant n
  Sampling sampling;
};

struct RigBoards {
  std::vector<calib::CameraSightings> cameras;
  std::vector<FoundBoards> found;  ///< by camera
};

/// Throws InputError as find_boards() does, and where not exactly one kind of source is given.
RigBoards find_rig_boards(const RigSources& sources, const calib::BoardDetector& detector);

}  // namespace v3d::calibrate
