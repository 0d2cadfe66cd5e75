#include "trigger/simulated.h"

#include <algorithm>
#include <chrono>
#include <utility>

#include "base/core/check.h"
#include "trigger/pulse_train.h"
#include "trigger/wire_socket.h"

namespace v3d {
namespace {

/// An edge that is later than this is not sent.
Duration standstill(Duration period) {
  return std::min<Duration>(std::chrono::seconds(1), 100 * period);
}

std::string vanished_text(const std::filesystem::path& path) {
  return "trigger wire " + path.string() + " vanished";
}

}  // namespace

SimulatedGenerator::SimulatedGenerator(std::filesystem::path wire, HostClock clock)
    : path_(std::move(wire)), train_(*this, std::move(clock)) {}

SimulatedGenerator::~SimulatedGenerator() = default;

void SimulatedGenerator::arm(const PulseTrain& train) {
  refuse_impossible(train, "simulated trigger");
  const Duration period = period_of(train.rate_hz);
  train_.plan({.period = period, .count = train.count, .skip_after = standstill(period)});
  wire_.reset();
  wire_ = std::make_unique<WireSocket>(path_);
}

void SimulatedGenerator::start() {
  V3D_CHECK(wire_ && "arm() comes first");
  train_.start();
}

bool SimulatedGenerator::begin_pulse(MonotonicInstant at) {
  wire_->drain();  // our own edges come back to us too; the sensor is who listens to them
  return wire_->send({to_ns(at)});
}

std::string SimulatedGenerator::fault() const {
  return train_.broken() ? vanished_text(path_) : train_.fault();
}

SimulatedSensor::SimulatedSensor(std::filesystem::path wire) : path_(std::move(wire)) {}
SimulatedSensor::~SimulatedSensor() = default;

void SimulatedSensor::reset() {
  next_ = 0;
  if (wire_) wire_->drain();
  if (!wire_ || wire_->vanished()) {
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
  sleep_until(deadline);  // a cable that vanished must not make its reader spin
  return {};
}

std::string SimulatedSensor::fault() const {
  if (!wire_) return "trigger wire " + path_.string() + " is not connected";
  return wire_->vanished() ? vanished_text(path_) : std::string();
}

}  // namespace v3d
