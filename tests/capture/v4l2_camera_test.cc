// V4l2Camera with a simulated kernel driver.
#include "capture/cameras/v4l2_camera.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <linux/videodev2.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cmath>
#include <deque>
#include <map>
#include <memory>
#include <string>
#include <vector>

#include "base/core/error.h"
#include "support/message_of.h"

namespace v3d::capture {
namespace {

using testing::AllOf;
using testing::HasSubstr;

constexpr uint32_t kTrigger = 0x009a0914;
constexpr uint32_t kStride = 8;  ///< of images 6 wide

/// Result of one VIDIOC_DQBUF call.
struct Delivery {
  uint32_t sequence = 0;
  int64_t us = 0;
  uint32_t flags = V4L2_BUF_FLAG_TIMESTAMP_MONOTONIC;
  uint32_t bytes = kStride * 4;
  int error = 0;  ///< of VIDIOC_DQBUF
};

/// State of the simulated driver; it outlives the opened devices.
struct Driver {
  uint32_t capabilities = V4L2_CAP_VIDEO_CAPTURE | V4L2_CAP_STREAMING;
  uint32_t format = V4L2_PIX_FMT_YUYV;
  uint32_t width = 6;
  uint32_t height = 4;
  std::vector<uint32_t> formats = {V4L2_PIX_FMT_YUYV, V4L2_PIX_FMT_GREY};
  uint32_t clock = V4L2_BUF_FLAG_TIMESTAMP_MONOTONIC;
  std::map<uint32_t, int32_t> controls = {{kTrigger, 0}, {V4L2_CID_EXPOSURE_ABSOLUTE, 333}};
  bool stores_controls = true;  ///< stores written control values
  uint32_t parm_capability = V4L2_CAP_TIMEPERFRAME;
  v4l2_fract interval{1, 30};
  std::vector<double> rates = {10, 25, 30000.0 / 1001};  ///< Hz; it selects the nearest one
  int queue_error = 0;

  std::deque<Delivery> deliveries;
  std::array<std::array<uint8_t, kStride * 4>, 8> memory{};
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
        return known(static_cast<v4l2_queryctrl*>(argument)->id);
      case VIDIOC_S_CTRL: {
        const auto& value = *static_cast<v4l2_control*>(argument);
        if (driver_.stores_controls && known(value.id) == 0)
          driver_.controls[value.id] = value.value;
        return known(value.id);
      }
      case VIDIOC_G_CTRL: {
        auto& value = *static_cast<v4l2_control*>(argument);
        if (known(value.id) == 0) value.value = driver_.controls[value.id];
        return known(value.id);
      }
      case VIDIOC_G_PARM:
      case VIDIOC_S_PARM:
        return rate(static_cast<v4l2_streamparm*>(argument)->parm.capture,
                    request == VIDIOC_S_PARM);
      case VIDIOC_REQBUFS:
        return 0;
      case VIDIOC_QUERYBUF: {
        auto& buffer = *static_cast<v4l2_buffer*>(argument);
        buffer.length = kStride * 4;
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
  int known(uint32_t id) const { return driver_.controls.contains(id) ? 0 : EINVAL; }

  int rate(v4l2_captureparm& parameters, bool set) {
    v4l2_fract& interval = parameters.timeperframe;
    if (set) {
      const double wanted = double{1} * interval.denominator / interval.numerator;
      const auto nearest = std::min_element(
          driver_.rates.begin(), driver_.rates.end(),
          [&](double a, double b) { return std::abs(a - wanted) < std::abs(b - wanted); });
      driver_.interval = {1'000'000, static_cast<uint32_t>(std::lround(1e6 * *nearest))};
    }
    parameters.capability = driver_.parm_capability;
    interval = driver_.interval;
    return 0;
  }

  int image_format(v4l2_format& format, bool set) {
    const uint32_t wanted = format.fmt.pix.pixelformat;
    if (set && std::count(driver_.formats.begin(), driver_.formats.end(), wanted) > 0) {
      driver_.format = wanted;
    }
    format.fmt.pix.width = driver_.width;
    format.fmt.pix.height = driver_.height;
    format.fmt.pix.pixelformat = driver_.format;
    format.fmt.pix.bytesperline = kStride;
    return 0;
  }

  int dequeue(v4l2_buffer& buffer) {
    const Delivery next = driver_.deliveries.front();
    driver_.deliveries.pop_front();
    if (next.error != 0) return next.error;
    buffer.index = driver_.queued.front();
    driver_.queued.pop_front();
    driver_.memory.at(buffer.index).fill(static_cast<uint8_t>(next.sequence));
    buffer.sequence = next.sequence;
    buffer.flags = next.flags;
    buffer.bytesused = next.bytes;
    buffer.timestamp = {.tv_sec = next.us / 1'000'000, .tv_usec = next.us % 1'000'000};
    return 0;
  }

  Driver& driver_;
};

class V4l2CameraTest : public testing::Test {
 protected:
  V4l2CameraTest() {
    settings_.name = "cam07";
    settings_.kind = CameraKind::kV4l2;
    settings_.address = "/dev/video7";
    settings_.pixel_format = PixelFormat::kMono8;
    settings_.exposure_us = 2000;
    settings_.trigger_control = kTrigger;
    settings_.trigger_value = 3;
    settings_.buffers = 4;
  }

  std::unique_ptr<V4l2Camera> camera() {
    return std::make_unique<V4l2Camera>(settings_, [this](const std::string& path) {
      EXPECT_EQ(path, "/dev/video7");
      return plugged_ ? std::make_unique<ScriptedDevice>(driver_)
                      : (errno = ENODEV, std::unique_ptr<ScriptedDevice>());
    });
  }
  std::string start_error() {
    return test::message_of<InputError>([&] { camera()->start(); });
  }

  Driver driver_;
  bool plugged_ = true;
  StudioCamera settings_;
};

TEST_F(V4l2CameraTest, writes_the_settings_into_the_camera) {
  const auto c = camera();
  c->start();
  EXPECT_EQ(driver_.format, V4L2_PIX_FMT_GREY);
  EXPECT_EQ(driver_.controls[kTrigger], 3);
  EXPECT_EQ(driver_.controls[V4L2_CID_EXPOSURE_ABSOLUTE], 20);
  EXPECT_EQ(driver_.queued.size(), 4U);
  EXPECT_TRUE(driver_.streaming);
  EXPECT_EQ(c->size(), (ImageSize{6, 4}));
  c->stop();
  c->stop();
  EXPECT_FALSE(driver_.streaming);
  EXPECT_EQ(driver_.open, 0);
}

TEST_F(V4l2CameraTest, delivers_frames_with_time_counter_and_rows_without_padding) {
  driver_.deliveries = {{.sequence = 7, .us = 12'000'040}, {.sequence = 9, .us = 12'080'040}};
  const auto c = camera();
  c->start();
  const auto first = c->wait({});
  ASSERT_TRUE(first);
  EXPECT_EQ(to_ns(first->device_time), 12'000'040'000);
  EXPECT_EQ(first->image.bytes, std::vector<uint8_t>(6 * 4, 7));
  const auto second = c->wait({});
  ASSERT_TRUE(second);
  EXPECT_EQ(second->counter, first->counter + 2) << "a frame that the driver dropped is counted";
  EXPECT_FALSE(c->wait({}));
  EXPECT_EQ(driver_.queued.size(), 4U) << "every buffer is returned to the driver";
  EXPECT_EQ(c->statistics().completed, 2);
}

TEST_F(V4l2CameraTest, unwraps_the_sequence_number) {
  driver_.deliveries = {{.sequence = 0xffffffff}, {.sequence = 0}, {.sequence = 0xffffffff}};
  const auto c = camera();
  c->start();
  const uint64_t before = c->wait({})->counter;
  EXPECT_EQ(c->wait({})->counter, before + 1);
  EXPECT_EQ(c->wait({})->counter, before) << "an out-of-order frame";
}

TEST_F(V4l2CameraTest, counts_erroneous_and_short_frames_as_damaged_and_drops_them) {
  constexpr uint32_t kBroken = V4L2_BUF_FLAG_TIMESTAMP_MONOTONIC | V4L2_BUF_FLAG_ERROR;
  driver_.deliveries = {{.sequence = 1, .flags = kBroken},
                        {.sequence = 2, .bytes = kStride * 3},
                        {.sequence = 3, .error = EAGAIN},
                        {.sequence = 4}};
  const auto c = camera();
  c->start();
  const auto frame = c->wait({});
  ASSERT_TRUE(frame);
  EXPECT_EQ(frame->image.bytes[0], 4);
  EXPECT_EQ(c->statistics().damaged, 2);
  EXPECT_EQ(c->statistics().completed, 1);
  EXPECT_FALSE(c->lost());
}

TEST_F(V4l2CameraTest, detects_a_disconnect_and_opens_the_camera_again) {
  for (const int error : {ENODEV, EIO}) {
    driver_.deliveries = {{.sequence = 1}, {.error = error}, {.sequence = 2}};
    auto c = camera();
    c->start();
    EXPECT_TRUE(c->wait({}));
    EXPECT_FALSE(c->wait({}));
    EXPECT_TRUE(c->lost());
    EXPECT_FALSE(c->wait({})) << "a lost camera is not accessed";
    c->stop();
    EXPECT_EQ(driver_.open, 0);
    plugged_ = false;
    EXPECT_THAT(test::message_of<InputError>([&] { c->start(); }),
                AllOf(HasSubstr("cam07"), HasSubstr("/dev/video7: No such device")));
    plugged_ = true;
    c->start();
    EXPECT_FALSE(c->lost());
    EXPECT_EQ(c->wait({})->image.bytes[0], 2);
  }
}

TEST_F(V4l2CameraTest, is_lost_if_the_kind_of_time_stamps_changes) {
  constexpr uint32_t kAtStart = V4L2_BUF_FLAG_TIMESTAMP_MONOTONIC | V4L2_BUF_FLAG_TSTAMP_SRC_SOE;
  for (const uint32_t flags : {kAtStart, uint32_t{V4L2_BUF_FLAG_TIMESTAMP_COPY}}) {
    driver_.deliveries = {{.sequence = 1}, {.sequence = 2, .flags = flags}};
    const auto c = camera();
    c->start();
    EXPECT_TRUE(c->wait({}));
    EXPECT_FALSE(c->wait({}));
    EXPECT_TRUE(c->lost());
  }
  driver_.clock = kAtStart;
  driver_.deliveries = {{.sequence = 1, .flags = kAtStart}};
  const auto c = camera();
  c->start();
  EXPECT_TRUE(c->wait({})) << "time stamps at the start of the exposure from the first frame on";
}

TEST_F(V4l2CameraTest, runs_free_at_the_pulse_rate_or_rejects_the_rate) {
  settings_.trigger_control.reset();
  const auto rated = [&](double hz) {
    auto c = camera();
    c->run_free(hz);
    return c;
  };
  rated(25)->start();
  EXPECT_EQ(driver_.controls[kTrigger], 0);
  EXPECT_EQ(driver_.interval.denominator, 25'000'000U);
  const auto refused = [&](double hz) {
    return test::message_of<InputError>([&] { rated(hz)->start(); });
  };
  EXPECT_THAT(refused(30),
              HasSubstr("frame rate of a free-running camera: wanted 30 Hz, got 29.97"));
  driver_.parm_capability = 0;
  EXPECT_THAT(refused(25), HasSubstr("a camera whose rate cannot be set"));
}

TEST_F(V4l2CameraTest, is_lost_if_the_driver_does_not_take_a_buffer_back) {
  const auto c = camera();
  c->start();
  driver_.deliveries = {{.sequence = 1}};
  driver_.queue_error = EINVAL;
  EXPECT_TRUE(c->wait({})) << "this frame is complete";
  EXPECT_TRUE(c->lost());
}

TEST_F(V4l2CameraTest, names_the_camera_and_the_rejected_setting) {
  driver_.formats = {V4L2_PIX_FMT_YUYV, V4L2_PIX_FMT_MJPEG};
  EXPECT_THAT(start_error(),
              HasSubstr("cam07: pixel_format: wanted Mono8, got YUYV; it has YUYV, MJPG"));
  driver_ = {};
  driver_.stores_controls = false;
  EXPECT_THAT(start_error(), HasSubstr("exposure_us / 100: wanted 20, got 333"));
  driver_ = {};
  driver_.controls.erase(kTrigger);
  EXPECT_THAT(start_error(),
              HasSubstr("trigger_control 0x009a0914: wanted 3, got Invalid argument"));
  driver_ = {};
  driver_.clock = V4L2_BUF_FLAG_TIMESTAMP_UNKNOWN;
  EXPECT_THAT(start_error(), HasSubstr("time stamps: wanted CLOCK_MONOTONIC"));
  driver_ = {};
  driver_.capabilities = V4L2_CAP_VIDEO_OUTPUT;
  EXPECT_THAT(start_error(), HasSubstr("a device that streams images"));
  driver_ = {};
  settings_.size = ImageSize{1024, 768};
  EXPECT_THAT(start_error(), HasSubstr("size: wanted 1024x768, got 6x4"));
  EXPECT_EQ(driver_.open, 0) << "a rejected device is closed";
}

}  // namespace
}  // namespace v3d::capture
