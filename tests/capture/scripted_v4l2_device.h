// Simulated kernel driver of a V4L2 camera, for tests.
#pragma once

#include <linux/videodev2.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cmath>
#include <cstring>
#include <deque>
#include <map>
#include <set>
#include <string>
#include <vector>

#include "capture/cameras/v4l2_camera.h"

namespace v3d::capture {

inline constexpr uint32_t kTrigger = 0x009a0914;
inline constexpr uint32_t kStride = 8;  ///< of images 6 wide
inline constexpr size_t kBufferBytes = 1024;

/// Result of one VIDIOC_DQBUF call.
struct Delivery {
  uint32_t sequence = 0;
  int64_t us = 0;
  uint32_t flags = V4L2_BUF_FLAG_TIMESTAMP_MONOTONIC;
  uint32_t bytes = kStride * 4;
  std::vector<uint8_t> content = {};  ///< empty: all bytes have the value `sequence`
  int error = 0;                      ///< of VIDIOC_DQBUF
};

/// State of the simulated driver; it outlives the opened devices.
struct Driver {
  uint32_t capabilities = V4L2_CAP_VIDEO_CAPTURE | V4L2_CAP_STREAMING;
  uint32_t format = V4L2_PIX_FMT_YUYV;
  uint32_t width = 6;
  uint32_t height = 4;
  std::vector<uint32_t> formats = {V4L2_PIX_FMT_YUYV, V4L2_PIX_FMT_GREY};
  uint32_t stride = kStride;
  uint32_t colorspace = V4L2_COLORSPACE_SRGB;
  uint32_t clock = V4L2_BUF_FLAG_TIMESTAMP_MONOTONIC;
  std::map<uint32_t, int32_t> controls = {{kTrigger, 0}, {V4L2_CID_EXPOSURE_ABSOLUTE, 333}};
  bool stores_controls = true;         ///< stores written control values
  std::set<uint32_t> fixed = {};       ///< controls that it ignores
  std::set<uint32_t> unreadable = {};  ///< controls whose value it does not return
  uint32_t control_flags = 0;          ///< of all controls
  uint32_t parm_capability = V4L2_CAP_TIMEPERFRAME;
  v4l2_fract interval{1, 30};
  std::vector<double> rates = {10, 25, 30000.0 / 1001};  ///< Hz; it selects the nearest one
  bool lists_rates = true;
  bool interval_bounds_exposure = false;
  bool has_parm = true;  ///< VIDIOC_G_PARM and VIDIOC_S_PARM
  int queue_error = 0;

  std::deque<Delivery> deliveries;
  std::array<std::array<uint8_t, kBufferBytes>, 8> memory{};
  std::deque<uint32_t> queued;
  bool streaming = false;
  int open = 0;  ///< number of open devices
};

class ScriptedDevice : public V4l2Device {
 public:
  explicit ScriptedDevice(Driver& driver) : driver_(driver) { ++driver_.open; }
  ~ScriptedDevice() override { --driver_.open; }

  bool wait(MonotonicInstant) override { return !driver_.deliveries.empty(); }

  std::span<const uint8_t> map(size_t bytes, uint32_t offset) override {
    return {driver_.memory.at(offset).data(), bytes};
  }

  int control(unsigned long request, void* argument) override {
    switch (request) {
      case VIDIOC_QUERYCAP:
        static_cast<v4l2_capability*>(argument)->capabilities = driver_.capabilities;
        return 0;
      case VIDIOC_G_FMT:
      case VIDIOC_S_FMT:
        return image_format(*static_cast<v4l2_format*>(argument), request == VIDIOC_S_FMT);
      case VIDIOC_ENUM_FMT: {
        auto& format = *static_cast<v4l2_fmtdesc*>(argument);
        if (format.index >= driver_.formats.size()) return EINVAL;
        format.pixelformat = driver_.formats[format.index];
        return 0;
      }
      case VIDIOC_QUERYCTRL:
        return query(*static_cast<v4l2_queryctrl*>(argument));
      case VIDIOC_S_CTRL: {
        const auto& value = *static_cast<v4l2_control*>(argument);
        if (driver_.stores_controls && known(value.id) == 0 && !driver_.fixed.contains(value.id)) {
          driver_.controls[value.id] = value.value;
          bound_exposure();
        }
        return known(value.id);
      }
      case VIDIOC_G_CTRL: {
        auto& value = *static_cast<v4l2_control*>(argument);
        if (driver_.unreadable.contains(value.id)) return EACCES;
        if (known(value.id) == 0) value.value = driver_.controls[value.id];
        return known(value.id);
      }
      case VIDIOC_G_PARM:
      case VIDIOC_S_PARM:
        if (!driver_.has_parm) return ENOTTY;
        return rate(static_cast<v4l2_streamparm*>(argument)->parm.capture,
                    request == VIDIOC_S_PARM);
      case VIDIOC_ENUM_FRAMEINTERVALS: {
        auto& entry = *static_cast<v4l2_frmivalenum*>(argument);
        if (!driver_.lists_rates || entry.index >= driver_.rates.size()) return EINVAL;
        entry.type = V4L2_FRMIVAL_TYPE_DISCRETE;
        entry.discrete = interval_of(driver_.rates[entry.index]);
        return 0;
      }
      case VIDIOC_REQBUFS:
        return 0;
      case VIDIOC_QUERYBUF: {
        auto& buffer = *static_cast<v4l2_buffer*>(argument);
        buffer.length = kBufferBytes;
        buffer.m.offset = buffer.index;
        buffer.flags = driver_.clock;
        return 0;
      }
      case VIDIOC_QBUF:
        driver_.queued.push_back(static_cast<v4l2_buffer*>(argument)->index);
        return driver_.queue_error;
      case VIDIOC_DQBUF:
        return dequeue(*static_cast<v4l2_buffer*>(argument));
      case VIDIOC_STREAMON:
      case VIDIOC_STREAMOFF:
        driver_.streaming = request == VIDIOC_STREAMON;
        if (!driver_.streaming) driver_.queued.clear();
        return 0;
      default:
        return ENOTTY;
    }
  }

 private:
  int query(v4l2_queryctrl& control) const {
    auto found = driver_.controls.find(control.id);
    if ((control.id & V4L2_CTRL_FLAG_NEXT_CTRL) != 0) {
      found = driver_.controls.upper_bound(control.id & ~V4L2_CTRL_FLAG_NEXT_CTRL);
    }
    if (found == driver_.controls.end()) return EINVAL;
    control.id = found->first;
    control.flags = driver_.control_flags;
    const char* const name = found->first == V4L2_CID_WHITE_BALANCE_TEMPERATURE
                                 ? "White Balance Temperature"
                                 : "Other, Control";
    std::strncpy(reinterpret_cast<char*>(control.name), name, sizeof control.name - 1);
    return 0;
  }

  int known(uint32_t id) const { return driver_.controls.contains(id) ? 0 : EINVAL; }

  static v4l2_fract interval_of(double hz) {
    return {1'000'000, static_cast<uint32_t>(std::lround(1e6 * hz))};
  }

  int rate(v4l2_captureparm& parameters, bool set) {
    v4l2_fract& interval = parameters.timeperframe;
    if (set) {
      const double wanted = double{1} * interval.denominator / interval.numerator;
      const auto nearest = std::min_element(
          driver_.rates.begin(), driver_.rates.end(),
          [&](double a, double b) { return std::abs(a - wanted) < std::abs(b - wanted); });
      driver_.interval = interval_of(*nearest);
      bound_exposure();
    }
    parameters.capability = driver_.parm_capability;
    interval = driver_.interval;
    return 0;
  }

  /// To one frame interval; the control counts in steps of 100 us.
  void bound_exposure() {
    const auto exposure = driver_.controls.find(V4L2_CID_EXPOSURE_ABSOLUTE);
    if (!driver_.interval_bounds_exposure || exposure == driver_.controls.end()) return;
    const double seconds = double{1} * driver_.interval.numerator / driver_.interval.denominator;
    exposure->second = std::min(exposure->second, static_cast<int32_t>(10'000 * seconds));
  }

  int image_format(v4l2_format& format, bool set) {
    const uint32_t wanted = format.fmt.pix.pixelformat;
    if (set && std::count(driver_.formats.begin(), driver_.formats.end(), wanted) > 0) {
      driver_.format = wanted;
    }
    format.fmt.pix.width = driver_.width;
    format.fmt.pix.height = driver_.height;
    format.fmt.pix.pixelformat = driver_.format;
    format.fmt.pix.bytesperline = driver_.stride;
    format.fmt.pix.colorspace = driver_.colorspace;
    return 0;
  }

  int dequeue(v4l2_buffer& buffer) {
    const Delivery next = driver_.deliveries.front();
    driver_.deliveries.pop_front();
    if (next.error != 0) return next.error;
    buffer.index = driver_.queued.front();
    driver_.queued.pop_front();
    auto& memory = driver_.memory.at(buffer.index);
    memory.fill(static_cast<uint8_t>(next.sequence));
    std::copy(next.content.begin(), next.content.end(), memory.begin());
    buffer.sequence = next.sequence;
    buffer.flags = next.flags;
    buffer.bytesused = next.bytes;
    buffer.timestamp = {.tv_sec = next.us / 1'000'000, .tv_usec = next.us % 1'000'000};
    return 0;
  }

  Driver& driver_;
};

}  // namespace v3d::capture
