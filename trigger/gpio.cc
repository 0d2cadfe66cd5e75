#include "trigger/gpio.h"

#include <utility>

#include "base/core/error.h"
#include "base/io/process.h"
#include "trigger/paced_train.h"

namespace v3d::trigger {
namespace {

/// A pulse that is later than period / kSkipDivisor is skipped.
constexpr int kSkipDivisor = 4;

}  // namespace

GpioGenerator::GpioGenerator(StudioLine line, OpenOutputLine open, HostClock clock)
    : line_(std::move(line)), open_(std::move(open)), train_(*this, std::move(clock)) {}

GpioGenerator::~GpioGenerator() = default;

void GpioGenerator::request_line(const PacedTrain::Plan& plan) {
  train_.plan(plan);
  if (output_ && output_->set(false)) return;
  output_.reset();
  output_ = open_(line_);
}

void GpioGenerator::silence() { request_line({}); }

void GpioGenerator::arm(const PulseTrain& train) {
  check_train(train, "GPIO trigger");
  const Duration period = period_of(train.rate_hz);
  if (train.width > period / 2) {
    throw InputError("GPIO trigger: a pulse of " +
                     std::to_string(train.width / std::chrono::microseconds(1)) +
                     " us is more than half a period; expected at most " +
                     std::to_string(period / 2 / std::chrono::microseconds(1)) + " us");
  }
  lock_memory();
  request_line({.period = period,
                .width = train.width,
                .count = train.count,
                .skip_after = period / kSkipDivisor});
}

void GpioGenerator::start() {
  V3D_CHECK(output_ && "arm() comes first");
  train_.start();
}

std::string GpioGenerator::fault() const {
  return train_.output_failed() ? "GPIO line " + line_text(line_) + " is gone" : train_.fault();
}

namespace {

constexpr Duration kPollInterval = std::chrono::milliseconds(100);
/// Longer than every pulse that a studio file allows.
constexpr Duration kMaxPulseWidth = std::chrono::milliseconds(1100);
/// Queue length: further pulses are counted as dropped.
constexpr size_t kMaxPulses = 65'536;

}  // namespace

GpioSensor::GpioSensor(StudioLine line, OpenInputLine open)
    : line_(std::move(line)), open_(std::move(open)) {}

GpioSensor::~GpioSensor() { stop_thread(); }

void GpioSensor::stop_thread() {
  stopping_ = true;
  if (thread_.joinable()) thread_.join();
  stopping_ = false;
}

void GpioSensor::reset() {
  stop_thread();
  pulse_start_.reset();
  input_.reset();
  input_ = open_(line_);
  pulses_.clear();
  next_number_ = dropped_ = 0;
  gone_ = false;
  thread_ = std::thread([this] { run(); });
}

void GpioSensor::run() {
  make_thread_realtime();
  while (!stopping_ && !input_->gone()) {
    if (const auto edge = input_->wait(Monotonic::now() + kPollInterval)) {
      on_edge(*edge);
    } else {
      report_overdue();  // while edges wait to be read, one of them may be the end of the pulse
    }
  }
  if (stopping_) return;
  const std::lock_guard lock(mutex_);
  gone_ = true;
}

void GpioSensor::on_edge(const LineEdge& edge) {
  if (!edge.active) {
    if (pulse_start_) report(edge.at - *pulse_start_);
    return;
  }
  if (pulse_start_) report({});
  pulse_start_ = edge.at;
}

void GpioSensor::report_overdue() {
  if (pulse_start_ && Monotonic::now() - *pulse_start_ > kMaxPulseWidth) report({});
}

void GpioSensor::report(std::optional<Duration> width) {
  const SensedPulse pulse{.number = next_number_, .at = *pulse_start_, .width = width};
  pulse_start_.reset();
  const std::lock_guard lock(mutex_);
  if (pulses_.size() >= kMaxPulses) {
    ++dropped_;
    return;
  }
  ++next_number_;
  pulses_.push_back(pulse);
  changed_.notify_one();
}

std::optional<SensedPulse> GpioSensor::wait(MonotonicInstant deadline) {
  std::unique_lock lock(mutex_);
  const auto left = deadline - Monotonic::now();
  if (!changed_.wait_for(lock, left, [&] { return !pulses_.empty(); })) return {};
  const SensedPulse pulse = pulses_.front();
  pulses_.pop_front();
  return pulse;
}

std::string GpioSensor::fault() const {
  const std::lock_guard lock(mutex_);
  if (!input_) return "GPIO line " + line_text(line_) + " is not read yet";
  if (gone_) return "GPIO line " + line_text(line_) + " is gone";
  if (dropped_ > 0)
    return std::to_string(dropped_) + " sensed pulses were lost: they were not read in time";
  return {};
}

}  // namespace v3d::trigger
