// Image check of a take: frame lag and displacement of each camera, from its silhouettes.
#pragma once

#include <filesystem>
#include <optional>
#include <vector>

#include "base/config/studio_file.h"
#include "recon/silhouettes/displaced_camera.h"
#include "recon/silhouettes/frame_lag.h"

namespace v3d::ctl {

struct ImageCheckRequest {
  std::filesystem::path take;
  std::optional<Studio> studio;  ///< gives the bounds if the take belongs to this studio
  int pulses = 50;               ///< number to compare, evenly spread over the take
};

/// Both lists have one entry for each camera.
struct ImageCheckResult {
  std::vector<CameraSync> frame_lags;
  std::vector<CameraDisplacement> displacements;
};

/// Compares the silhouettes of each camera with its leave-one-out hull, at its own and at
/// neighbouring pulses.
/// Throws InputError without a calibration, for frames with neither mask nor background model, and
/// for a take with too few pulses. Uses all processors.
ImageCheckResult check_images(const ImageCheckRequest& request);

/// A line for each camera with a frame lag. Without any, a line for each displaced camera: a lag
/// shifts silhouettes too.
std::vector<std::string> fault_lines(const ImageCheckResult& result);

}  // namespace v3d::ctl
