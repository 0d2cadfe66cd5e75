#include "trigger/make_trigger.h"

#include "base/error.h"
#include "trigger/simulated.h"

namespace v3d {

std::unique_ptr<PulseGenerator> make_generator(const StudioTrigger& trigger) {
  switch (trigger.kind) {
    case TriggerKind::kSimulated:
      return std::make_unique<SimulatedGenerator>(trigger.wire);
  }
  throw InputError("trigger: kind is not one that this build has; right would be simulated");
}

std::unique_ptr<PulseSensor> make_sensor(const StudioTrigger& trigger) {
  switch (trigger.kind) {
    case TriggerKind::kSimulated:
      return std::make_unique<SimulatedSensor>(trigger.wire);
  }
  throw InputError("trigger: kind is not one that this build has; right would be simulated");
}

}  // namespace v3d
