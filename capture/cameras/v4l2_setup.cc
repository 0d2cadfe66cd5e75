#include <fmt/core.h>

#include <algorithm>
#include <array>
#include <cctype>
#include <charconv>
#include <cmath>
#include <cstring>
#include <limits>

#include "base/core/error.h"
#include "base/core/text.h"
#include "capture/cameras/v4l2_camera.h"

namespace v3d::capture::v4l2 {
namespace {

constexpr uint32_t kCapture = V4L2_BUF_TYPE_VIDEO_CAPTURE;
constexpr double kExposureStepUs = 100;  ///< the unit of V4L2_CID_EXPOSURE_ABSOLUTE
/// Relative error of a frame rate. It distinguishes 29.97 Hz from 30 Hz.
constexpr double kRateTolerance = 2e-4;
constexpr double kTicks = 1000;  ///< resolution of a frame interval: ticks in its numerator

/// A control with which a camera changes its pictures by itself.
struct AutomaticControl {
  uint32_t id;
  const char* name;  ///< as v4l2-ctl --list-ctrls prints it
  int32_t off;
};

/// Exposure first: cameras accept an exposure time only in manual mode.
constexpr std::array<AutomaticControl, 9> kAutomaticControls = {{
    {V4L2_CID_EXPOSURE_AUTO, "auto_exposure", V4L2_EXPOSURE_MANUAL},
    {V4L2_CID_EXPOSURE_AUTO_PRIORITY, "exposure_dynamic_framerate", 0},
    {V4L2_CID_AUTOGAIN, "gain_automatic", 0},
    {V4L2_CID_AUTOBRIGHTNESS, "brightness_automatic", 0},
    {V4L2_CID_AUTO_WHITE_BALANCE, "white_balance_automatic", 0},
    {V4L2_CID_HUE_AUTO, "hue_automatic", 0},
    {V4L2_CID_FOCUS_AUTO, "focus_automatic_continuous", 0},
    {V4L2_CID_POWER_LINE_FREQUENCY, "power_line_frequency", V4L2_CID_POWER_LINE_FREQUENCY_DISABLED},
    {V4L2_CID_ISO_SENSITIVITY_AUTO, "iso_sensitivity_auto", V4L2_ISO_SENSITIVITY_MANUAL},
}};

std::string text_of(uint32_t fourcc) {
  std::string text;
  for (int shift = 0; shift < 32; shift += 8) text += static_cast<char>(fourcc >> shift & 0x7f);
  return text;
}

std::string hexadecimal(uint32_t id) { return fmt::format("0x{:08x}", id); }

std::string number(double value) { return fmt::format("{:.6g}", value); }

/// Without an exponent up to 9,999,999.
std::string microseconds(double value) { return fmt::format("{:.7g}", value); }

/// The name of a control in the form of v4l2-ctl: "White Balance, Automatic" becomes
/// "white_balance_automatic".
std::string control_name(const v4l2_queryctrl& control) {
  const auto* const text = reinterpret_cast<const char*>(control.name);
  std::string name;
  for (const char c : std::string(text, strnlen(text, sizeof control.name))) {
    if (std::isalnum(static_cast<unsigned char>(c)) != 0) {
      name += static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
    } else if (!name.empty() && name.back() != '_') {
      name += '_';
    }
  }
  while (name.ends_with('_')) name.pop_back();
  return name;
}

/// A whole number of 32 bits, true or false.
std::optional<int32_t> control_value(const std::string& text) {
  if (text == "true" || text == "false") return text == "true" ? 1 : 0;
  int32_t value = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  const bool whole = error == std::errc() && end == text.data() + text.size();
  return whole ? std::optional(value) : std::nullopt;
}

/// How the driver describes the colours of a YUV image.
YuvCoding yuv_coding(const v4l2_pix_format& format) {
  uint32_t matrix = format.ycbcr_enc;
  if (matrix == V4L2_YCBCR_ENC_DEFAULT) matrix = V4L2_MAP_YCBCR_ENC_DEFAULT(format.colorspace);
  uint32_t range = format.quantization;
  if (range == V4L2_QUANTIZATION_DEFAULT) {
    range = V4L2_MAP_QUANTIZATION_DEFAULT(false, format.colorspace, matrix);
  }
  return {.is_bt709 = matrix == V4L2_YCBCR_ENC_709 || matrix == V4L2_YCBCR_ENC_XV709,
          .is_full_range = range == V4L2_QUANTIZATION_FULL_RANGE};
}

v4l2_fract interval_of(double hz) {
  return {.numerator = static_cast<uint32_t>(kTicks),
          .denominator = static_cast<uint32_t>(std::lround(hz * kTicks))};
}

/// Hz; 0 where the driver gives no interval.
double rate_of(const v4l2_fract& interval) {
  return interval.numerator == 0 ? 0 : double{1} * interval.denominator / interval.numerator;
}

class Setup {
 public:
  Setup(const StudioCamera& settings, std::optional<double> rate_hz, V4l2Device& device)
      : settings_(settings), rate_hz_(rate_hz), device_(device) {}

  Applied all() {
    const std::string device = capabilities();
    const v4l2_pix_format format = image_format();
    prepare_interval(format);
    for (const AutomaticControl& control : kAutomaticControls) switch_off(control);
    exposure();
    for (const CameraFeature& feature : settings_.features) write(feature);
    if (settings_.trigger_control) {
      trigger(*settings_.trigger_control);
      if (rate_hz_) frame_interval(format, *rate_hz_);
    } else {
      rate(rate_hz_.value_or(0));
    }
    const ImageSize size{static_cast<int>(format.width), static_cast<int>(format.height)};
    return {{settings_.pixel_format, size, format.bytesperline, yuv_coding(format)},
            device,
            std::move(differences_),
            trigger_rate_hz_};
  }

 private:
  [[noreturn]] void fail(const std::string& what, const std::string& wanted,
                         const std::string& got) const {
    v4l2::fail(settings_, what, wanted, got);
  }
  void control_or_throw(const std::string& what, unsigned long request, void* argument) const {
    v4l2::control_or_throw(settings_, device_, what, request, argument);
  }

  /// Checks the kind of the device. Returns its name and driver.
  std::string capabilities() const {
    v4l2_capability caps{};
    control_or_throw(settings_.address, VIDIOC_QUERYCAP, &caps);
    const uint32_t has =
        (caps.capabilities & V4L2_CAP_DEVICE_CAPS) != 0 ? caps.device_caps : caps.capabilities;
    if ((has & V4L2_CAP_VIDEO_CAPTURE) == 0 || (has & V4L2_CAP_STREAMING) == 0) {
      fail(settings_.address, "a device that streams images", "another kind of device");
    }
    const auto text = [](const uint8_t* bytes, size_t limit) {
      const auto* const first = reinterpret_cast<const char*>(bytes);
      return printable(std::string_view(first, strnlen(first, limit)));
    };
    return text(caps.card, sizeof caps.card) + ", driver " + text(caps.driver, sizeof caps.driver);
  }

  v4l2_pix_format image_format() const {
    v4l2_format format{};
    format.type = kCapture;
    control_or_throw("image format", VIDIOC_G_FMT, &format);
    const auto fourcc = fourcc_of(settings_.pixel_format);
    V3D_CHECK(fourcc.has_value());  // the reader of the studio file accepts no other format
    const std::string wanted(name(settings_.pixel_format));
    const ImageSize size = settings_.size.value_or(
        ImageSize{static_cast<int>(format.fmt.pix.width), static_cast<int>(format.fmt.pix.height)});
    format.fmt.pix = {};
    format.fmt.pix.width = static_cast<uint32_t>(size.width);
    format.fmt.pix.height = static_cast<uint32_t>(size.height);
    format.fmt.pix.pixelformat = *fourcc;
    format.fmt.pix.field = V4L2_FIELD_NONE;
    control_or_throw("image format", VIDIOC_S_FMT, &format);
    control_or_throw("image format", VIDIOC_G_FMT, &format);
    const v4l2_pix_format& got = format.fmt.pix;
    if (got.pixelformat != *fourcc) {
      fail("pixel_format", wanted, text_of(got.pixelformat) + "; it has " + formats());
    }
    check_size(size, got);
    return got;
  }

  void check_size(ImageSize size, const v4l2_pix_format& got) const {
    const ImageSize got_size{static_cast<int>(got.width), static_cast<int>(got.height)};
    if (got_size != size) fail("size", format_size(size), format_size(got_size));
    const int step = width_step(settings_.pixel_format);
    if (size.width % step != 0) {
      fail("width", "a multiple of " + std::to_string(step), std::to_string(size.width));
    }
    const size_t row = row_bytes(settings_.pixel_format, size.width);
    if (size.width > kMaxImageSide || size.height > kMaxImageSide || got.bytesperline < row) {
      fail("image format", format_size(size), std::to_string(got.bytesperline) + " bytes a row");
    }
  }

  std::string formats() const {
    std::string list;
    v4l2_fmtdesc format{};
    format.type = kCapture;
    while (device_.control(VIDIOC_ENUM_FMT, &format) == 0 && format.index < 256) {
      list += (list.empty() ? "" : ", ") + text_of(format.pixelformat);
      ++format.index;
    }
    return list.empty() ? "none" : list;
  }

  bool supports(uint32_t id) const {
    v4l2_queryctrl query{};
    query.id = id;
    return device_.control(VIDIOC_QUERYCTRL, &query) == 0 &&
           (query.flags & V4L2_CTRL_FLAG_DISABLED) == 0;
  }

  std::optional<int32_t> value_of(uint32_t id) const {
    v4l2_control value{.id = id, .value = 0};
    return device_.control(VIDIOC_G_CTRL, &value) == 0 ? std::optional(value.value) : std::nullopt;
  }

  /// A camera that ignores this keeps a picture that changes by itself, which is worth a warning:
  /// the frames are still those of their pulses.
  void switch_off(const AutomaticControl& control) {
    if (!supports(control.id)) return;
    v4l2_control value{.id = control.id, .value = control.off};
    device_.control(VIDIOC_S_CTRL, &value);  // error ignored: the value read back decides
    const auto got = value_of(control.id);
    if (got == control.off) return;
    differences_.push_back(
        {control.name, std::to_string(control.off), got ? std::to_string(*got) : "no answer"});
  }

  /// The control with a name as v4l2-ctl prints it. Empty if there is none.
  std::optional<v4l2_queryctrl> control_named(const std::string& wanted) const {
    v4l2_queryctrl query{};
    query.id = V4L2_CTRL_FLAG_NEXT_CTRL;
    while (device_.control(VIDIOC_QUERYCTRL, &query) == 0) {
      if (control_name(query) == wanted) return query;
      query.id |= V4L2_CTRL_FLAG_NEXT_CTRL;
    }
    return std::nullopt;
  }

  /// Writes a control of the table [camera.features].
  void write(const CameraFeature& feature) {
    const auto found = control_named(feature.name);
    if (!found) fail(feature.name, feature.value, "a camera without this control");
    const auto wanted = control_value(feature.value);
    if (!wanted) fail(feature.name, "a whole number, true or false", feature.value);
    v4l2_control value{.id = found->id, .value = *wanted};
    const int error = device_.control(VIDIOC_S_CTRL, &value);
    const bool readable =
        found->type != V4L2_CTRL_TYPE_BUTTON && (found->flags & V4L2_CTRL_FLAG_WRITE_ONLY) == 0;
    if (error == 0 && !readable) return;
    const auto got = value_of(found->id);
    if (error == 0 && got == *wanted) return;
    const std::string without_value = error != 0 ? std::strerror(error) : "no answer";
    differences_.push_back(
        {feature.name, feature.value, got ? std::to_string(*got) : without_value});
  }

  /// Writes a control, reads it back and returns its value.
  int32_t control(const std::string& what, uint32_t id, int32_t wanted,
                  int32_t tolerance = 0) const {
    v4l2_control value{.id = id, .value = wanted};
    ask_for(what, wanted, VIDIOC_S_CTRL, &value);
    value = {.id = id, .value = 0};
    control_or_throw(what, VIDIOC_G_CTRL, &value);
    if (std::abs(int64_t{value.value} - wanted) > tolerance) {
      fail(what, std::to_string(wanted), std::to_string(value.value));
    }
    return value.value;
  }

  void ask_for(const std::string& what, int32_t wanted, unsigned long request,
               void* argument) const {
    const int error = device_.control(request, argument);
    if (error != 0) fail(what, std::to_string(wanted), std::strerror(error));
  }

  void trigger(uint32_t id) const {
    control("trigger_control " + hexadecimal(id), id, settings_.trigger_value);
  }

  /// The interval that the camera has from before may bound the exposure time. So it is written
  /// before the exposure, without a check, and again after all settings that may change it.
  void prepare_interval(const v4l2_pix_format& format) const {
    v4l2_streamparm parameters{};
    parameters.type = kCapture;
    if (!rate_hz_ || !has_interval(parameters)) return;
    parameters.parm.capture.timeperframe =
        settings_.trigger_control ? best_interval(format, *rate_hz_) : interval_of(*rate_hz_);
    device_.control(VIDIOC_S_PARM, &parameters);  // error ignored: the later check decides
  }

  /// Reads the parameters. False where the driver has no frame interval.
  bool has_interval(v4l2_streamparm& parameters) const {
    return device_.control(VIDIOC_G_PARM, &parameters) == 0 &&
           (parameters.parm.capture.capability & V4L2_CAP_TIMEPERFRAME) != 0;
  }

  /// Sets the frame interval of a free-running camera and reads it back.
  void rate(double hz) const {
    v4l2_streamparm parameters{};
    parameters.type = kCapture;
    control_or_throw("rate", VIDIOC_G_PARM, &parameters);
    v4l2_fract& interval = parameters.parm.capture.timeperframe;
    if ((parameters.parm.capture.capability & V4L2_CAP_TIMEPERFRAME) == 0) {
      fail("rate", number(hz) + " Hz", "a camera whose rate cannot be set");
    }
    interval = interval_of(hz);
    control_or_throw("rate", VIDIOC_S_PARM, &parameters);
    control_or_throw("rate", VIDIOC_G_PARM, &parameters);
    const double got = rate_of(interval);
    if (std::abs(got - hz) > kRateTolerance * hz) {
      fail("frame rate of a free-running camera", number(hz) + " Hz", number(got) + " Hz");
    }
  }

  /// The longest interval of the driver that is not longer than a period, else its shortest one. A
  /// driver that lists none chooses by itself.
  v4l2_fract best_interval(const v4l2_pix_format& format, double hz) const {
    v4l2_fract best = interval_of(hz);
    double best_hz = 0;
    v4l2_frmivalenum entry{};
    entry.pixel_format = format.pixelformat;
    entry.width = format.width;
    entry.height = format.height;
    constexpr uint32_t kMaxIntervals = 256;
    while (entry.index < kMaxIntervals &&
           device_.control(VIDIOC_ENUM_FRAMEINTERVALS, &entry) == 0 &&
           entry.type == V4L2_FRMIVAL_TYPE_DISCRETE) {
      const double entry_hz = rate_of(entry.discrete);
      const bool is_slower = entry_hz < best_hz;
      const bool is_better = is_fast_enough(best_hz, hz) ? is_slower && is_fast_enough(entry_hz, hz)
                                                         : entry_hz > best_hz;
      if (is_better) {
        best = entry.discrete;
        best_hz = entry_hz;
      }
      ++entry.index;
    }
    return best;
  }

  /// Sets the frame interval of a triggered camera and reads it back. A longer one than the period
  /// is a warning: whether the camera then ignores pulses depends on its driver, and missing frames
  /// are counted.
  void frame_interval(const v4l2_pix_format& format, double hz) {
    v4l2_streamparm parameters{};
    parameters.type = kCapture;
    if (!has_interval(parameters)) return;
    v4l2_fract& interval = parameters.parm.capture.timeperframe;
    interval = best_interval(format, hz);
    device_.control(VIDIOC_S_PARM, &parameters);  // error ignored: the value read back decides
    const bool is_known = device_.control(VIDIOC_G_PARM, &parameters) == 0;
    const double got = is_known ? rate_of(interval) : 0;
    trigger_rate_hz_ = std::max(got, hz);  // another attempt at `hz` changes nothing
    if (is_fast_enough(got, hz)) return;
    differences_.push_back({"frame rate", "at least " + number(hz) + " Hz", number(got) + " Hz"});
  }

  /// Sets the exposure time. A camera without the control has a fixed exposure, or is a frame
  /// grabber.
  void exposure() {
    if (!supports(V4L2_CID_EXPOSURE_ABSOLUTE)) return;
    const auto steps = static_cast<int32_t>(std::lround(settings_.exposure_us / kExposureStepUs));
    // Any value: compare_exposure() decides.
    const int32_t got = control("exposure_us / 100", V4L2_CID_EXPOSURE_ABSOLUTE, std::max(steps, 1),
                                std::numeric_limits<int32_t>::max());
    compare_exposure(settings_.exposure_us, kExposureStepUs * got);
  }

  /// Lists an exposure time that differs. The steps of V4L2 are large beside a short time, so a
  /// step counts as a rounding only where it is at most 10 % of the time. Half or twice the time,
  /// and so the blur, is rejected.
  void compare_exposure(double wanted, double got) {
    if (got == wanted) return;
    if (got > 2 * wanted || 2 * got < wanted) {
      fail(
          "exposure_us", microseconds(wanted),
          microseconds(got) + (wanted < kExposureStepUs ? "; V4L2 counts in steps of 100 us" : ""));
    }
    const double rounding = std::max(0.01 * wanted, std::min(kExposureStepUs, 0.1 * wanted));
    differences_.push_back({"exposure_us", microseconds(wanted), microseconds(got),
                            std::abs(got - wanted) <= rounding});
  }

  const StudioCamera& settings_;
  const std::optional<double> rate_hz_;
  V4l2Device& device_;
  std::vector<SettingDifference> differences_;
  std::optional<double> trigger_rate_hz_;
};

}  // namespace

bool is_fast_enough(double got_hz, double hz) { return got_hz >= hz * (1 - kRateTolerance); }

void fail(const StudioCamera& settings, const std::string& what, const std::string& wanted,
          const std::string& got) {
  throw InputError("camera " + settings.name + ": " + what + ": expected " + wanted + ", found " +
                   got);
}

void control_or_throw(const StudioCamera& settings, V4l2Device& device, const std::string& what,
                      unsigned long request, void* argument) {
  const int error = device.control(request, argument);
  if (error != 0) fail(settings, what, "an answer", std::strerror(error));
}

Applied write_settings(const StudioCamera& settings, std::optional<double> rate_hz,
                       V4l2Device& device) {
  return Setup(settings, rate_hz, device).all();
}

}  // namespace v3d::capture::v4l2
