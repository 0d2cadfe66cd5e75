// GPIO lines by libgpiod 2.
#include <gpiod.h>

#include <algorithm>
#include <cerrno>
#include <filesystem>
#include <new>
#include <utility>

#include "base/core/error.h"
#include "base/io/process.h"
#include "trigger/gpio_lines.h"

namespace v3d::trigger {
namespace {

constexpr const char* kConsumer = "v3d-captured";

struct Closer {
  void operator()(gpiod_chip* chip) const { gpiod_chip_close(chip); }
  void operator()(gpiod_chip_info* info) const { gpiod_chip_info_free(info); }
  void operator()(gpiod_line_settings* settings) const { gpiod_line_settings_free(settings); }
  void operator()(gpiod_line_config* config) const { gpiod_line_config_free(config); }
  void operator()(gpiod_request_config* config) const { gpiod_request_config_free(config); }
  void operator()(gpiod_line_request* request) const { gpiod_line_request_release(request); }
  void operator()(gpiod_edge_event_buffer* events) const { gpiod_edge_event_buffer_free(events); }
};
template <class T>
using Owner = std::unique_ptr<T, Closer>;

bool is_number(const std::string& text) {
  return !text.empty() && std::ranges::all_of(text, [](char c) { return c >= '0' && c <= '9'; });
}

bool has_label(gpiod_chip* chip, const std::string& label) {
  const Owner<gpiod_chip_info> info(gpiod_chip_get_info(chip));
  return info && gpiod_chip_info_get_label(info.get()) == label;
}

/// By path, name, number or label, as libgpiod 1.6 looks chips up. Null without such a chip; then
/// errno is set.
Owner<gpiod_chip> open_chip(const std::string& wanted) {
  namespace fs = std::filesystem;
  const std::string prefix = is_number(wanted)         ? "/dev/gpiochip"
                             : wanted.starts_with('/') ? ""
                                                       : "/dev/";
  const std::string path = prefix + wanted;
  if (gpiod_is_gpiochip_device(path.c_str())) {
    return Owner<gpiod_chip>(gpiod_chip_open(path.c_str()));
  }
  std::error_code ignored;
  for (const auto& entry : fs::directory_iterator("/dev", ignored)) {
    if (!entry.path().filename().string().starts_with("gpiochip")) continue;
    Owner<gpiod_chip> chip(gpiod_chip_open(entry.path().c_str()));
    if (chip && has_label(chip.get(), wanted)) return chip;
  }
  errno = ENOENT;
  return nullptr;
}

/// A requested line. The request keeps it when the chip is closed.
struct Line {
  Owner<gpiod_line_request> request;
  unsigned offset = 0;
};

/// How a line is requested.
struct Wanted {
  gpiod_line_direction direction;
  gpiod_line_edge edges;
};

bool has_line(gpiod_chip* chip, unsigned offset) {
  const Owner<gpiod_chip_info> info(gpiod_chip_get_info(chip));
  return info && offset < gpiod_chip_info_get_num_lines(info.get());
}

unsigned offset_of(gpiod_chip* chip, const StudioLine& line) {
  if (const auto number = number_of(line)) {
    if (has_line(chip, *number)) return *number;
  } else {
    const int offset = gpiod_chip_get_line_offset_from_name(chip, line.line.c_str());
    if (offset >= 0) return static_cast<unsigned>(offset);
  }
  throw InputError("GPIO line " + line_text(line) + ": no such line; gpioinfo lists the lines");
}

Line request(const StudioLine& line, const Wanted& wanted) {
  const Owner<gpiod_chip> chip = open_chip(line.chip);
  if (!chip) {
    throw InputError(errno_message("GPIO chip " + line.chip) + "; gpiodetect lists the chips");
  }
  Line found{.request = nullptr, .offset = offset_of(chip.get(), line)};
  const Owner<gpiod_line_settings> settings(gpiod_line_settings_new());
  const Owner<gpiod_line_config> lines(gpiod_line_config_new());
  const Owner<gpiod_request_config> config(gpiod_request_config_new());
  if (!settings || !lines || !config) throw std::bad_alloc();
  gpiod_line_settings_set_active_low(settings.get(), line.active_low);
  gpiod_request_config_set_consumer(config.get(), kConsumer);
  // A line starts inactive; the clock of the stamps is CLOCK_MONOTONIC, libgpiod's default.
  const bool done =
      gpiod_line_settings_set_direction(settings.get(), wanted.direction) == 0 &&
      gpiod_line_settings_set_edge_detection(settings.get(), wanted.edges) == 0 &&
      gpiod_line_config_add_line_settings(lines.get(), &found.offset, 1, settings.get()) == 0;
  if (done) found.request.reset(gpiod_chip_request_lines(chip.get(), config.get(), lines.get()));
  if (!found.request) {
    throw InputError(errno_message("GPIO line " + line_text(line)) +
                     "; gpioinfo shows which program uses it");
  }
  return found;
}

class GpioOutput : public OutputLine {
 public:
  explicit GpioOutput(const StudioLine& line)
      : line_(request(line, {GPIOD_LINE_DIRECTION_OUTPUT, GPIOD_LINE_EDGE_NONE})) {}
  ~GpioOutput() override { set(false); }
  GpioOutput(const GpioOutput&) = delete;
  GpioOutput& operator=(const GpioOutput&) = delete;

  bool set(bool active) override {
    return gpiod_line_request_set_value(
               line_.request.get(), line_.offset,
               active ? GPIOD_LINE_VALUE_ACTIVE : GPIOD_LINE_VALUE_INACTIVE) == 0;
  }

 private:
  const Line line_;
};

class GpioInput : public InputLine {
 public:
  explicit GpioInput(const StudioLine& line)
      : line_(request(line, {GPIOD_LINE_DIRECTION_INPUT, GPIOD_LINE_EDGE_BOTH})),
        event_(gpiod_edge_event_buffer_new(1)) {
    if (!event_) throw std::bad_alloc();
  }

  std::optional<LineEdge> wait(MonotonicInstant deadline) override {
    if (gone_) return {};
    const std::chrono::nanoseconds left = std::max(Duration::zero(), deadline - Monotonic::now());
    const int ready = gpiod_line_request_wait_edge_events(line_.request.get(), left.count());
    if (ready == 0 || (ready < 0 && errno == EINTR)) return {};
    gone_ =
        ready < 0 || gpiod_line_request_read_edge_events(line_.request.get(), event_.get(), 1) != 1;
    if (gone_) return {};
    gpiod_edge_event* const event = gpiod_edge_event_buffer_get_event(event_.get(), 0);
    return LineEdge{
        .active = gpiod_edge_event_get_event_type(event) == GPIOD_EDGE_EVENT_RISING_EDGE,
        .at = from_ns<Monotonic>(static_cast<int64_t>(gpiod_edge_event_get_timestamp_ns(event)))};
  }
  bool gone() const override { return gone_; }

 private:
  const Line line_;
  const Owner<gpiod_edge_event_buffer> event_;
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
