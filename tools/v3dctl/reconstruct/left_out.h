// Cameras that a command is to do without.
#pragma once

#include <string>
#include <vector>

#include "take/take.h"

namespace v3d::ctl {

/// Cameras of a take without those in `left_out`. Throws InputError for a name that the take does
/// not have and when none remains.
std::vector<std::string> cameras_without(const TakeInfo& info,
                                         const std::vector<std::string>& left_out);

}  // namespace v3d::ctl
