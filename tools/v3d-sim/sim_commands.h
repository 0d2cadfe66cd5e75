// Commands of v3d-sim, their common options, studio file and check.
#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include "base/config/calib_file.h"
#include "base/geometry/camera_model.h"
#include "cli/command.h"
#include "sim/cameras/exposure_record.h"

namespace v3d::sim {

// The commands of v3d-sim. Each function adds a command, which writes its exit status to `status`
// when it is run.

void add_take_command(cli::Command app, int& status);
void add_studio_command(cli::Command app, int& status);
void add_check_command(cli::Command app, int& status);

// Command line options that several commands of v3d-sim share.

/// Parameters of the simulated studio.
struct StudioOptions {
  int cameras = 15;
  std::string size = "1024x768";
  std::string rig{};  ///< calibration file; empty: make_rig() with the two values above
  uint64_t seed = 1;
  double rate_hz = 25;
};

/// Adds --cameras, --size, --rig, --seed and --rate.
void add_studio_options(cli::Command command, StudioOptions& options);

/// The rig of the studio. Throws InputError for an invalid image size, and for a calibration file
/// that cannot be read or has too many cameras.
Rig rig_of(const StudioOptions& options);

// The studio file of a simulated studio.

struct StudioText {
  double rate_hz = 25;
  double voxel_m = 0.01;
  std::string pixel_format = "BayerRG8";
  bool has_action_trigger = false;  ///< action commands instead of the simulated cable
};

/// Throws InputError when `folder` has a studio.toml or calib.toml that v3d-sim did not write: both
/// would be replaced, and the calibration of a studio takes hours.
void require_own_studio(const std::filesystem::path& folder);

/// Throws InputError when `images` of each camera of the rig, and its renderer, need more than 80 %
/// of `available` bytes. `rig_file`: the value of --rig, for the message.
void require_memory(const Rig& rig, int64_t images, int64_t available, const std::string& rig_file);

/// The text of studio.toml for the fake cameras of `rig`, as load_studio() reads it. Cameras and
/// trigger belong to node cap01; recon01 is the reconstruction node.
std::string studio_text(const Rig& rig, const StudioText& options);

// Comparison of a recorded take with the simulator's exposure record.

struct TakeCheck {
  int64_t frames_received = 0;
  int64_t frames_missing = 0;           ///< pulses without a frame, over all cameras
  int64_t frames_mislabelled = 0;       ///< frames labelled with a wrong pulse
  int64_t mislabelled_not_suspect = 0;  ///< mislabelled frames that are not marked suspect
  int64_t frames_repeated = 0;          ///< frames of an exposure beyond the images that were sent
  int64_t images_wrong = 0;             ///< pulses whose image has other bytes than the sent one
  std::vector<std::string> problems;    ///< the first problems, one line each
  bool whole() const {
    return frames_missing == 0 && frames_mislabelled == 0 && frames_repeated == 0 &&
           images_wrong == 0;
  }
};

/// A label is correct when the record has an exposure of the frame's camera and device time, at the
/// edge whose time pulses.lcmlog gives for the frame's pulse. This edge must be the pulse-th one,
/// counted from the edge of pulse 0. The image that readers use for a pulse has the checksum of the
/// record, where that is known. Throws InputError for a take that cannot be read.
TakeCheck check_take(const std::filesystem::path& take, const std::vector<ExposureLine>& record);

}  // namespace v3d::sim
