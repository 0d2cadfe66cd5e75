// Names that a take may have, and orders that record no take.
#pragma once

#include <string>

#include "wire/messages.h"

namespace v3d::control {

/// Throws InputError with one line when the name is not a file name, or is reserved: for a check,
/// for learning the background, or for the quarantine.
void check_take_name(const std::string& take);

/// A value of health that is 1 while the node is armed or has pulses for v3dctl check or
/// background. They record no take; HealthMessage::take is then "check" or "background". Otherwise
/// absent.
inline constexpr char kUnrecordedFlag[] = "unrecorded_flag";
bool records_nothing(const wire::HealthMessage& health);

}  // namespace v3d::control
