#include "trigger/simulated.h"

#include <algorithm>
#include <cassert>
#include <cmath>
#include <utility>

#include "base/error.h"
#include "base/punctual.h"
#include "trigger/wire_socket.h"

namespace v3d {
namespace {

/// stop() is heard within this time.
constexpr Duration kLongestSleep = std::chrono::milliseconds(20);

[[noreturn]] void refuse(const std::string& what, const std::string& right) {
  throw InputError("simulated trigger: " + what + "; right would be " + right);
}

void check(const PulseTrain& train) {
  const double rate = train.rate_hz;
  if (!(rate >= kSimulatedMinRateHz && rate <= kSimulatedMaxRateHz)) {
    refuse("rate " + std::to_string(rate) + " Hz", "0.01 to 1000 Hz");
  }
  if (train.width <= Duration::zero() || train.width >= period_of(rate)) {
    refuse("pulse width " + std::to_string(train.width.count()) + " ns at " + std::to_string(rate) +
               " Hz",
           "more than 0 and less than the period");
  }
  if (train.count && *train.count < 1) {
    refuse("count " + std::to_string(*train.count), "at least 1, or none for a train without end");
  }
}

std::string vanished_text(const std::filesystem::path& path) {
  return "trigger wire " + path.string() + " vanished";
}

}  // namespace

SimulatedGenerator::SimulatedGenerator(std::filesystem::path wire, HostClock clock)
    : path_(std::move(wire)), clock_(std::move(clock)) {}

SimulatedGenerator::~SimulatedGenerator() {
  stop();
  join();
}

void SimulatedGenerator::arm(const PulseTrain& train) {
  check(train);
  stop();
  join();
  wire_.reset();
  wire_ = std::make_unique<WireSocket>(path_);
  train_ = train;
  period_ = period_of(train.rate_hz);
  const std::lock_guard lock(mutex_);
  commanded_ = skipped_ = 0;
  latest_ = {};
  vanished_ = false;
}

void SimulatedGenerator::start() {
  assert(wire_ && "arm() comes first");
  stop();
  join();
  {
    const std::lock_guard lock(mutex_);
    stopped_ = false;
    commanded_ = skipped_ = 0;
    latest_ = {};
  }
  thread_ = std::thread([this, first = clock_.now() + period_ / 2] { run(first); });
}

void SimulatedGenerator::stop() {
  const std::lock_guard lock(mutex_);
  stopped_ = true;
}

void SimulatedGenerator::join() {
  if (thread_.joinable()) thread_.join();
}

void SimulatedGenerator::run(MonotonicInstant first) {
  become_punctual();
  if (!wait_for(first)) return;
  first = std::max(first, clock_.now());
  for (int64_t k = 0;; ++k) {
    const MonotonicInstant at = first + k * period_;
    if (!wait_for(at) || !pulse(k, at)) return;
  }
}

bool SimulatedGenerator::wait_for(MonotonicInstant instant) const {
  for (;;) {
    {
      const std::lock_guard lock(mutex_);
      if (stopped_) return false;
    }
    const MonotonicInstant now = clock_.now();
    if (now >= instant) return true;
    clock_.sleep_until(std::min(instant, now + kLongestSleep));
  }
}

bool SimulatedGenerator::pulse(int64_t number, MonotonicInstant at) {
  const std::lock_guard lock(mutex_);
  if (stopped_) return false;
  wire_->drain();  // our own edges come back to us too; the sensor is who listens to them
  const Duration late = clock_.now() - at;
  latest_ = std::max(latest_, late);
  if (late >= period_) {
    ++skipped_;
  } else if (!wire_->send({to_ns(at)})) {
    vanished_ = true;
    stopped_ = true;
    return false;
  }
  commanded_ = number + 1;
  if (train_.count && commanded_ == *train_.count) stopped_ = true;
  return !stopped_;
}

int64_t SimulatedGenerator::commanded() const {
  const std::lock_guard lock(mutex_);
  return commanded_;
}

bool SimulatedGenerator::finished() const {
  const std::lock_guard lock(mutex_);
  return stopped_;
}

Duration SimulatedGenerator::worst_lateness() const {
  const std::lock_guard lock(mutex_);
  return latest_;
}

std::string SimulatedGenerator::fault() const {
  const std::lock_guard lock(mutex_);
  if (vanished_) return vanished_text(path_);
  if (skipped_ == 0) return {};
  return std::to_string(skipped_) + " pulses skipped: this host was up to " +
         std::to_string(latest_ / std::chrono::milliseconds(1)) + " ms late";
}

int64_t SimulatedGenerator::skipped() const {
  const std::lock_guard lock(mutex_);
  return skipped_;
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
