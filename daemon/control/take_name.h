// Names that a take may have.
#pragma once

#include <string>

namespace v3d::control {

/// Throws InputError with one line when the name is not a file name, or is reserved: for a check,
/// for learning the background, or for the quarantine. Health has these as the take of a check and
/// of learning.
void check_take_name(const std::string& take);

}  // namespace v3d::control
