// GPIO lines by libgpiod 1.6.
#include <gpiod.h>

#include <algorithm>
#include <cerrno>
#include <utility>

#include "base/core/error.h"
#include "base/io/process.h"
#include "trigger/gpio_lines.h"
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

Line find(const StudioLine& wanted) {
  Line found;
  found.chip.reset(gpiod_chip_open_lookup(wanted.chip.c_str()));
  if (!found.chip) {
    throw InputError(errno_message("GPIO chip " + wanted.chip) + "; gpiodetect lists the chips");
  }
  const auto number = number_of(wanted);
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

std::unique_ptr<OutputLine> open_output_line(const StudioLine& line) {
  return std::make_unique<GpioOutput>(line);
}

std::unique_ptr<InputLine> open_input_line(const StudioLine& line) {
  return std::make_unique<GpioInput>(line);
}

}  // namespace v3d::trigger
