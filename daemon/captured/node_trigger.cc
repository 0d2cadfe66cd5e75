#include "daemon/captured/node_trigger.h"

#include <algorithm>

#include "trigger/make_trigger.h"

namespace v3d {

NodeTrigger::NodeTrigger(const Studio& studio, const std::string& node, Bus& bus)
    : is_sensed_(studio.trigger.is_sensed()) {
  if (studio.trigger.node == node) {
    generator_ = make_generator(studio.trigger);
    sensor_ = make_sensor(studio.trigger);
  } else {
    monitor_ = std::make_unique<TrainMonitor>(bus, studio.trigger.node);
  }
}

void NodeTrigger::arm(const PulseTrain& train) {
  if (!generator_) return;
  generator_->stop();
  generator_->arm(train);
}

void NodeTrigger::start() {
  first_pulse_reported_ = false;
  if (monitor_) monitor_->reset();
  if (generator_) generator_->start();
}

void NodeTrigger::stop() {
  if (generator_) generator_->stop();
}

std::optional<PulseEdge> NodeTrigger::unsensed_first_pulse() {
  if (first_pulse_reported_ || sensor_ || !generator_) return std::nullopt;
  const auto first = generator_->first_pulse();
  if (!first) return std::nullopt;
  first_pulse_reported_ = true;
  return PulseEdge{.pulse = 0, .at = *first};
}

void NodeTrigger::poll(const std::string& take) {
  if (monitor_) monitor_->poll(take);
}

bool NodeTrigger::train_has_ended(const std::string& take) {
  poll(take);
  return generator_ ? generator_->finished() : monitor_->ended();
}

bool NodeTrigger::sensor_count_is_better() const {
  return generator_ && sensor_ && !generator_->counts_exactly();
}

int64_t NodeTrigger::commanded(int64_t seen) const {
  if (sensor_count_is_better()) return seen;
  // On other nodes: the messages of the last pulses may have been lost.
  return generator_ ? generator_->commanded() : std::max(seen, monitor_->commanded());
}

std::optional<PulseStatistics> NodeTrigger::statistics() const {
  return generator_ ? std::optional(generator_->statistics()) : std::nullopt;
}

}  // namespace v3d
