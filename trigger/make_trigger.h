// Factories of the generator and the sense line that a studio file describes.
#pragma once

#include <memory>

#include "base/config/studio_file.h"
#include "trigger/pulse_generator.h"

namespace v3d {

/// Do not access the hardware; arm() and reset() do.
std::unique_ptr<PulseGenerator> make_generator(const StudioTrigger& trigger);
/// Null where the studio has no sense line.
std::unique_ptr<PulseSensor> make_sensor(const StudioTrigger& trigger);

}  // namespace v3d
