#include "trigger/gpio_sensor.h"

#include <utility>

#include "base/core/realtime_thread.h"

namespace v3d {
namespace {

constexpr Duration kLook = std::chrono::milliseconds(100);
/// The longest pulse that a studio file may ask for, and more.
constexpr Duration kLongestPulse = std::chrono::milliseconds(1100);
/// Many seconds of pulses that nobody takes.
constexpr size_t kMaxPulses = 65'536;

}  // namespace

GpioSensor::GpioSensor(StudioLine line, OpenInputLine open)
    : line_(std::move(line)), open_(std::move(open)) {}

GpioSensor::~GpioSensor() { end_thread(); }

void GpioSensor::end_thread() {
  stopping_ = true;
  if (thread_.joinable()) thread_.join();
  stopping_ = false;
}

void GpioSensor::reset() {
  end_thread();
  begun_.reset();
  input_.reset();
  input_ = open_(line_);
  pulses_.clear();
  next_ = dropped_ = 0;
  gone_ = false;
  thread_ = std::thread([this] { run(); });
}

void GpioSensor::run() {
  make_thread_realtime();
  while (!stopping_ && !input_->gone()) {
    if (const auto edge = input_->wait(Monotonic::now() + kLook)) hear(*edge);
    tell_overdue();
  }
  if (stopping_) return;
  const std::lock_guard lock(mutex_);
  gone_ = true;
}

void GpioSensor::hear(const LineEdge& edge) {
  if (!edge.begins) {
    if (begun_) tell(edge.at - *begun_);
    return;
  }
  if (begun_) tell({});
  begun_ = edge.at;
}

void GpioSensor::tell_overdue() {
  if (begun_ && Monotonic::now() - *begun_ > kLongestPulse) tell({});
}

void GpioSensor::tell(std::optional<Duration> width) {
  const SensedPulse pulse{.number = next_, .at = *begun_, .width = width};
  begun_.reset();
  const std::lock_guard lock(mutex_);
  if (pulses_.size() >= kMaxPulses) {
    ++dropped_;
    return;
  }
  ++next_;
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
  if (dropped_ > 0) return std::to_string(dropped_) + " sensed pulses were not taken in time";
  return {};
}

}  // namespace v3d
