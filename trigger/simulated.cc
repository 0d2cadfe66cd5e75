#include "trigger/simulated.h"

#include <algorithm>
#include <chrono>
#include <utility>

#include "base/core/check.h"
#include "trigger/pulse_train.h"
#include "trigger/wire_socket.h"

namespace v3d {
namespace {

/// Edges that are later than this are skipped.
Duration max_lateness(Duration period) {
  return std::min<Duration>(std::chrono::seconds(1), 100 * period);
}

std::string disconnected_text(const std::filesystem::path& path) {
  return "trigger wire " + path.string() + ": connection lost";
}

}  // namespace

SimulatedGenerator::SimulatedGenerator(std::filesystem::path wire, HostClock clock)
    : path_(std::move(wire)), train_(*this, std::move(clock)) {}

SimulatedGenerator::~SimulatedGenerator() = default;

void SimulatedGenerator::arm(const PulseTrain& train) {
  check_train(train, "simulated trigger");
  const Duration period = period_of(train.rate_hz);
  train_.plan({.period = period, .count = train.count, .skip_after = max_lateness(period)});
  wire_.reset();
  wire_ = std::make_unique<WireSocket>(path_);
}

void SimulatedGenerator::start() {
  V3D_CHECK(wire_ && "arm() comes first");
  train_.start();
}

bool SimulatedGenerator::begin_pulse(MonotonicInstant at) {
  wire_->drain();  // the echo of own edges; the sensor reads its own copy
  return wire_->send({to_ns(at)});
}

std::string SimulatedGenerator::fault() const {
  return train_.output_failed() ? disconnected_text(path_) : train_.fault();
}

SimulatedSensor::SimulatedSensor(std::filesystem::path wire) : path_(std::move(wire)) {}
SimulatedSensor::~SimulatedSensor() = default;

void SimulatedSensor::reset() {
  next_ = 0;
  if (wire_) wire_->drain();
  if (!wire_ || wire_->disconnected()) {
    wire_.reset();
    wire_ = std::make_unique<WireSocket>(path_);
  }
}

std::optional<SensedPulse> SimulatedSensor::wait(MonotonicInstant deadline) {
  if (wire_) {
    if (auto edge = wire_->receive(deadline)) {
      return SensedPulse{next_++, from_ns<Monotonic>(edge->edge_monotonic_ns)};
    }
  }
  sleep_until(deadline);  // so that the caller does not spin after a disconnection
  return {};
}

std::string SimulatedSensor::fault() const {
  if (!wire_) return "trigger wire " + path_.string() + " is not connected";
  return wire_->disconnected() ? disconnected_text(path_) : std::string();
}

}  // namespace v3d
