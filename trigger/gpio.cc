#include "trigger/gpio.h"

#include <gpiod.h>

#include <algorithm>
#include <charconv>
#include <utility>

#include "base/core/error.h"
#include "base/io/process.h"
#include "trigger/paced_train.h"

namespace v3d::trigger {
namespace {

constexpr const char* kConsumer = "v3d-captured";

struct ChipCloser {
  void operator()(gpiod_chip* chip) const { gpiod_chip_close(chip); }
};

/// A line and its chip; closing the chip releases the line.
struct Line {
  std::unique_ptr<gpiod_chip, ChipCloser> chip;
  gpiod_line* line = nullptr;
};

std::optional<unsigned> number_of(const std::string& text) {
  unsigned number = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), number);
  const bool whole = error == std::errc() && end == text.data() + text.size();
  return whole ? std::optional(number) : std::nullopt;
}

Line find(const StudioLine& wanted) {
  Line found;
  found.chip.reset(gpiod_chip_open_lookup(wanted.chip.c_str()));
  if (!found.chip) {
    throw InputError(errno_message("GPIO chip " + wanted.chip) + "; gpiodetect lists the chips");
  }
  const auto number = number_of(wanted.line);
  found.line = number ? gpiod_chip_get_line(found.chip.get(), *number)
                      : gpiod_chip_find_line(found.chip.get(), wanted.line.c_str());
  if (found.line == nullptr) {
    throw InputError("GPIO line " + line_text(wanted) + ": no such line; gpioinfo lists the lines");
  }
  return found;
}

int flags_of(const StudioLine& line) {
  return line.active_low ? GPIOD_LINE_REQUEST_FLAG_ACTIVE_LOW : 0;
}

[[noreturn]] void throw_request_error(const StudioLine& line) {
  throw InputError(errno_message("GPIO line " + line_text(line)) +
                   "; gpioinfo shows which program uses it");
}

class GpioOutput : public OutputLine {
 public:
  explicit GpioOutput(const StudioLine& line) : line_(find(line)) {
    if (gpiod_line_request_output_flags(line_.line, kConsumer, flags_of(line), 0) != 0) {
      throw_request_error(line);
    }
  }
  ~GpioOutput() override { set(false); }
  GpioOutput(const GpioOutput&) = delete;
  GpioOutput& operator=(const GpioOutput&) = delete;

  bool set(bool active) override { return gpiod_line_set_value(line_.line, active ? 1 : 0) == 0; }

 private:
  const Line line_;
};

class GpioInput : public InputLine {
 public:
  explicit GpioInput(const StudioLine& line) : line_(find(line)) {
    if (gpiod_line_request_both_edges_events_flags(line_.line, kConsumer, flags_of(line)) != 0) {
      throw_request_error(line);
    }
  }

  std::optional<LineEdge> wait(MonotonicInstant deadline) override {
    if (gone_) return {};
    const timespec remaining = to_timespec(std::max(Duration::zero(), deadline - Monotonic::now()));
    const int ready = gpiod_line_event_wait(line_.line, &remaining);
    if (ready == 0 || (ready < 0 && errno == EINTR)) return {};
    gpiod_line_event event{};
    gone_ = ready < 0 || gpiod_line_event_read(line_.line, &event) != 0;
    if (gone_) return {};
    return LineEdge{.active = event.event_type == GPIOD_LINE_EVENT_RISING_EDGE,
                    .at = MonotonicInstant(std::chrono::seconds(event.ts.tv_sec) +
                                           std::chrono::nanoseconds(event.ts.tv_nsec))};
  }
  bool gone() const override { return gone_; }

 private:
  const Line line_;
  bool gone_ = false;
};

}  // namespace

std::string line_text(const StudioLine& line) { return line.line + " of " + line.chip; }

std::unique_ptr<OutputLine> open_output_line(const StudioLine& line) {
  return std::make_unique<GpioOutput>(line);
}

std::unique_ptr<InputLine> open_input_line(const StudioLine& line) {
  return std::make_unique<GpioInput>(line);
}

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
                     " us is more than half a period; right would be at most " +
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
    if (const auto edge = input_->wait(Monotonic::now() + kPollInterval)) on_edge(*edge);
    report_overdue();
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
