// Image sources of all cameras of a rig, and the boards in their images.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "calib/boards/detectors.h"
#include "calibrate/calibration_images.h"
#include "v3dctl/command_line.h"
#include "v3dctl/options.h"

namespace v3d::calibrate {

/// The images of all cameras. Exactly one of videos, images and take is given.
struct RigSources {
  std::vector<ctl::CameraFile> videos;
  std::vector<ctl::CameraFile> images;  ///< patterns
  std::filesystem::path take;
  std::filesystem::path time_stamps;  ///< for videos; empty: frame n is instant n
  Sampling sampling;
};

/// The command line options for RigSources.
struct RigArguments {
  std::vector<std::string> videos;
  std::vector<std::string> images;
  double live_s = 0;
  RigSources given;

  void add_to(cli::Command command);
  /// Adds --timestamps.
  void add_time_stamps_to(cli::Command command);
  /// Records a take first where --live is given. Throws InputError for a malformed or repeated
  /// CAM=FILE, for several kinds of sources, and for options that the given kind does not use; also
  /// throws like record_live_take().
  RigSources sources(const ctl::CommandLine& line) const;

 private:
  void require_used_options() const;
};

/// Throws InputError for --every with --images, which has no effect on them.
void require_no_interval_of_images(const Sampling& sampling, bool has_images);

/// Adds the option --live SECONDS.
void add_live_option(cli::Command command, double& seconds);

struct NamedSource {
  std::string camera;
  ImageSource source;
};

/// One source for each camera, in the given order. Throws InputError unless exactly one kind of
/// source is given, and for a file that cannot be opened.
std::vector<NamedSource> open_sources(const RigSources& sources);

struct RigBoards {
  std::vector<calib::CameraObservations> cameras;
  std::vector<FoundBoards> found;  ///< by camera
};

/// Searches the images of all cameras. Throws like find_boards() and open_sources(), and where
/// lists of images have different lengths.
RigBoards find_rig_boards(const RigSources& sources, const calib::BoardDetector& detector);

/// What to do where the images of a camera are late or early.
std::string time_offset_remedy(const RigSources& sources);

// Search for a small, slanted board on the floor, with the calibrated rig as a prediction.

/// Searches for the board in up to five images of each camera.
///
/// Where a camera finds the board, the rig predicts its pose for the other cameras, which are then
/// searched at that pose. Cameras without the board are omitted. Throws InputError for a camera
/// that `rig` lacks or has with another image size; also throws like open_sources().
std::vector<calib::CameraObservations> find_floor_boards(const RigSources& sources, const Rig& rig,
                                                         const calib::BoardDetector& detector);

}  // namespace v3d::calibrate
