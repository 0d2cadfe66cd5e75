#include "trigger/pulse_generator.h"

#include "base/config/studio_values.h"
#include "base/core/error.h"
#include "trigger/action_generator.h"
#include "trigger/background_generator.h"
#include "trigger/gpio.h"
#include "trigger/scpi/scpi_generator.h"
#include "trigger/simulated_trigger.h"

namespace v3d::trigger {

void check_train(const PulseTrain& train, const std::string& source) {
  const auto reject = [&](const std::string& what, const std::string& right) {
    throw InputError(source + ": " + what + "; expected " + right);
  };
  const double rate = train.rate_hz;
  if (!is_pulse_rate(rate)) throw InputError(source + ": " + pulse_rate_error(rate));
  if (train.width <= Duration::zero() || train.width >= period_of(rate)) {
    reject("pulse width " + std::to_string(train.width.count()) + " ns at " + std::to_string(rate) +
               " Hz",
           "more than 0 and less than the period");
  }
  if (train.count && *train.count < 1) {
    reject("count " + std::to_string(*train.count), "at least 1, or none for a train without end");
  }
}

std::unique_ptr<PulseGenerator> make_generator(const StudioTrigger& trigger) {
  switch (trigger.kind) {
    case TriggerKind::kSimulated:
      return std::make_unique<SimulatedGenerator>(trigger.wire);
    case TriggerKind::kGpio:
      return std::make_unique<GpioGenerator>(trigger.output);
    case TriggerKind::kAction:
      return std::make_unique<ActionGenerator>(trigger.action);
    case TriggerKind::kScpi:
      break;
  }
  return std::make_unique<BackgroundGenerator>(std::make_unique<ScpiGenerator>(trigger));
}

std::unique_ptr<PulseSensor> PulseGenerator::own_sensor() { return nullptr; }

std::unique_ptr<PulseSensor> make_sensor(const StudioTrigger& trigger, PulseGenerator& generator) {
  if (trigger.kind == TriggerKind::kSimulated) {
    return std::make_unique<SimulatedSensor>(trigger.wire);
  }
  if (trigger.sense) return std::make_unique<GpioSensor>(*trigger.sense);
  return generator.own_sensor();
}

}  // namespace v3d::trigger
