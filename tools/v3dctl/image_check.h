// What the images of a take say of its cameras: which of them are out of step.
#pragma once

#include <filesystem>
#include <optional>
#include <vector>

#include "base/studio_file.h"
#include "recon/synchronism.h"

namespace v3d::ctl {

struct ImageCheckRequest {
  std::filesystem::path take;
  std::optional<Studio> studio;  ///< gives the space where it is the take's
  int pulses = 50;               ///< that are compared, spread over the take
};

/// By camera. Throws InputError as the reconstruction does: no calibration, frames with neither a
/// mask nor a background model; and for a take of fewer pulses than are compared at a time.
std::vector<CameraSynchronism> check_images(const ImageCheckRequest& request);

/// "cam07: its silhouettes fit the hull of the others 1 pulse later ...", for every camera out of
/// step.
std::vector<std::string> lines_of_cameras_out_of_step(
    const std::vector<CameraSynchronism>& cameras);

}  // namespace v3d::ctl
