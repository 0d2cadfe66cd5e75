// Comparison of a recorded take with the simulator's exposure record.
#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include "sim/cameras/exposure_record.h"

namespace v3d::sim {

struct TakeCheck {
  int64_t frames_received = 0;
  int64_t frames_missing = 0;           ///< pulses without a frame, over all cameras
  int64_t frames_mislabelled = 0;       ///< frames labelled with a wrong pulse
  int64_t mislabelled_not_suspect = 0;  ///< mislabelled frames that are not marked suspect
  std::vector<std::string> problems;    ///< the first problems, one line each
  bool whole() const { return frames_missing == 0 && frames_mislabelled == 0; }
};

/// A label is correct when the record has an exposure of the frame's camera and device time, at the
/// edge whose time pulses.lcmlog gives for the frame's pulse. This edge must be the pulse-th one,
/// counted from the edge of pulse 0. Throws InputError for a take that cannot be read.
TakeCheck check_take(const std::filesystem::path& take, const std::vector<ExposureLine>& record);

}  // namespace v3d::sim
