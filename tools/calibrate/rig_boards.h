// The boards that all cameras of a rig saw, from files.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "calib/board_detector.h"
#include "calib/pair_poses.h"
#include "calibrate/board_search.h"
#include "v3dctl/command_line.h"
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

/// The options that say where the pictures of all cameras come from.
struct RigArguments {
  std::vector<std::string> videos;
  std::vector<std::string> images;
  double live_s = 0;
  RigSources given;

  void add_to(CLI::App* command);
  /// Records a take first, where --live says so. Throws InputError for a malformed or repeated
  /// CAM=FILE, and as record_live_take() does.
  RigSources sources(const ctl::CommandLine& line) const;
};

/// --live SECONDS.
void add_live_option(CLI::App* command, double& seconds);

struct NamedSource {
  std::string camera;
  PictureSource source;
};

/// By camera, in the order given. Throws InputError where not exactly one kind of source is given,
/// or a file cannot be opened.
std::vector<NamedSource> open_sources(const RigSources& sources);

struct RigBoards {
  std::vector<calib::CameraSightings> cameras;
  std::vector<FoundBoards> found;  ///< by camera
};

/// Throws InputError as find_boards() and open_sources() do.
RigBoards find_rig_boards(const RigSources& sources, const calib::BoardDetector& detector);

}  // namespace v3d::calibrate
