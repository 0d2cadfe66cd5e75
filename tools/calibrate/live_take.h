// Recording a short take with the running studio, as a source of calibration images.
#pragma once

#include <filesystem>

#include "base/config/studio_file.h"

namespace v3d::calibrate {

/// Records the take calibration-<date>-<time> of `seconds` with at most 5 pulses per second,
/// through the operator's protocol, and returns its folder.
///
/// The folder is that of the recording where this PC has all cameras; else the take is collected
/// from the nodes into the current folder. The take is kept. Progress, missing frames and the
/// folder are printed on stderr. Throws InputError where the studio cannot be reached or collected
/// from, and std::runtime_error where a node rejects the recording or the user interrupts it.
std::filesystem::path record_live_take(const Studio& studio, double seconds);

}  // namespace v3d::calibrate
