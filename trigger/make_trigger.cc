#include "trigger/make_trigger.h"

#include "trigger/background_generator.h"
#include "trigger/gpio_generator.h"
#include "trigger/gpio_sensor.h"
#include "trigger/scpi/scpi_generator.h"
#include "trigger/simulated.h"

namespace v3d {

std::unique_ptr<PulseGenerator> make_generator(const StudioTrigger& trigger) {
  switch (trigger.kind) {
    case TriggerKind::kSimulated:
      return std::make_unique<SimulatedGenerator>(trigger.wire);
    case TriggerKind::kGpio:
      return std::make_unique<GpioGenerator>(trigger.output);
    case TriggerKind::kScpi:
      break;
  }
  return std::make_unique<BackgroundGenerator>(std::make_unique<ScpiGenerator>(trigger));
}

std::unique_ptr<PulseSensor> make_sensor(const StudioTrigger& trigger) {
  if (trigger.kind == TriggerKind::kSimulated) {
    return std::make_unique<SimulatedSensor>(trigger.wire);
  }
  return trigger.sense ? std::make_unique<GpioSensor>(*trigger.sense) : nullptr;
}

}  // namespace v3d
