// What the images of a take say of its cameras: which of them are out of step, and which were
// knocked out of their place.
#pragma once

#include <filesystem>
#include <optional>
#include <vector>

#include "base/studio_file.h"
#include "recon/drift.h"
#include "recon/synchronism.h"

namespace v3d::ctl {

struct ImageCheckRequest {
  std::filesystem::path take;
  std::optional<Studio> studio;  ///< gives the space where it is the take's
  int pulses = 50;               ///< that are compared, spread over the take
};

/// Both by camera.
struct ImageCheckResult {
  std::vector<CameraSynchronism> synchronism;
  std::vector<CameraDrift> drift;
};

/// Throws InputError as the reconstruction does: no calibration, frames with neither a mask nor a
/// background model; and for a take of fewer pulses than are compared at a time.
ImageCheckResult check_images(const ImageCheckRequest& request);

/// "cam07: its silhouettes fit the hull of the others 1 pulse later ...", for every camera out of
/// step, and "cam04: knocked ..." for one that was.
std::vector<std::string> lines_of(const ImageCheckResult& result);

}  // namespace v3d::ctl
