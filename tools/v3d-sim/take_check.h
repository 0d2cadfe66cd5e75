// A recorded take against the simulator's own record.
#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include "sim/exposure_record.h"

namespace v3d::sim {

struct TakeCheck {
  int64_t frames_received = 0;
  int64_t frames_missing = 0;         ///< pulses of the take without a frame, all cameras together
  int64_t frames_mislabelled = 0;     ///< frames that show another edge than their pulse was
  int64_t silently = 0;               ///< of these, without being marked suspect
  std::vector<std::string> problems;  ///< one line each, the first ones
  bool whole() const { return frames_missing == 0 && frames_mislabelled == 0; }
};

/// A frame is labelled rightly when its (camera, device time) is an exposure in the record, of the
/// edge whose time pulses.lcmlog gives for the frame's pulse, and that edge is the pulse-th of the
/// train (counted from the edge of pulse 0). Throws InputError where the take cannot be read.
TakeCheck check_take(const std::filesystem::path& take, const std::vector<ExposureLine>& record);

}  // namespace v3d::sim
