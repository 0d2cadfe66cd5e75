// The studio's own cameras as a source of pictures: a short take of them.
#pragma once

#include <filesystem>

#include "base/studio_file.h"

namespace v3d::calibrate {

/// Records a take calibration-<date>-<time> of `seconds` with the running daemons, as an operator
/// would, a few pulses a second, and gives its folder: where it was recorded, when that is here,
/// else in the current folder, where it was collected from the nodes. It stays. Tells on stderr
/// what to do, what is missing, and where the take is. Throws InputError where the studio cannot be
/// joined or collected from, std::runtime_error where a node refuses, and when the person
/// interrupts it.
std::filesystem::path record_live_take(const Studio& studio, double seconds);

}  // namespace v3d::calibrate
