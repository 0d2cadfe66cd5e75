// The generator and the sense line that a studio file asks for.
#pragma once

#include <memory>

#include "base/config/studio_file.h"
#include "trigger/pulse_generator.h"

namespace v3d {

/// Touch no hardware yet: arm() and reset() do.
std::unique_ptr<PulseGenerator> make_generator(const StudioTrigger& trigger);
/// Null where the studio has no sense line.
std::unique_ptr<PulseSensor> make_sensor(const StudioTrigger& trigger);

}  // namespace v3d
