// V4l2Camera with a simulated kernel driver.
#include "capture/cameras/v4l2_camera.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <linux/videodev2.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cmath>
#include <cstring>
#include <deque>
#include <map>
#include <memory>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "base/core/error.h"
#include "base/image/image_files.h"
#include "capture/scripted_v4l2_device.h"
#include "support/message_of.h"

namespace v3d::capture {
namespace {

using testing::AllOf;
using testing::HasSubstr;

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
    c->set_rate(hz);
    return c;
  };
  rated(25)->start();
  EXPECT_EQ(driver_.controls[kTrigger], 0);
  EXPECT_EQ(driver_.interval.denominator, 25'000'000U);
  const auto refused = [&](double hz) {
    return test::message_of<InputError>([&] { rated(hz)->start(); });
  };
  EXPECT_THAT(refused(30),
              HasSubstr("frame rate of a free-running camera: expected 30 Hz, found 29.97"));
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

TEST_F(V4l2CameraTest, gives_a_triggered_camera_the_longest_interval_within_a_period) {
  driver_.rates = {10, 60, 24, 30, 25};
  const auto rate_at = [&](double hz) {
    const auto c = camera();
    c->set_rate(hz);
    c->start();
    EXPECT_TRUE(c->differences().empty()) << hz;
    return driver_.interval.denominator / 1e6;
  };
  EXPECT_EQ(rate_at(25), 25);
  EXPECT_EQ(rate_at(24.5), 25) << "24 Hz is nearer, but too slow";
  EXPECT_EQ(rate_at(31), 60);
  driver_.lists_rates = false;
  EXPECT_EQ(rate_at(10), 10) << "the driver selects";
}

TEST_F(V4l2CameraTest, warns_of_a_triggered_camera_whose_interval_is_longer_than_the_period) {
  driver_.rates = {10, 30};
  const auto c = camera();
  c->set_rate(50);
  c->start();
  EXPECT_EQ(driver_.interval.denominator, 30'000'000U) << "the shortest interval";
  EXPECT_THAT(c->differences(),
              testing::ElementsAre(SettingDifference{"frame rate", "at least 50 Hz", "30 Hz"}));
  EXPECT_TRUE(driver_.streaming);
  EXPECT_TRUE(c->keeps_up_with(std::chrono::milliseconds(20))) << "another start changes nothing";
}

TEST_F(V4l2CameraTest, must_be_started_again_for_pulses_faster_than_its_interval) {
  driver_.rates = {25, 60};
  const auto c = camera();
  c->set_rate(25);
  c->start();
  EXPECT_TRUE(c->keeps_up_with(std::chrono::milliseconds(40)));
  EXPECT_TRUE(c->keeps_up_with(std::chrono::milliseconds(200)));
  EXPECT_FALSE(c->keeps_up_with(std::chrono::milliseconds(20)));
  driver_.parm_capability = 0;
  c->start();
  EXPECT_TRUE(c->keeps_up_with(std::chrono::milliseconds(20))) << "no interval bounds it";
}

TEST_F(V4l2CameraTest, triggers_a_camera_whose_driver_has_no_frame_intervals) {
  driver_.parm_capability = 0;
  for (const bool has_parm : {true, false}) {
    driver_.has_parm = has_parm;
    const auto c = camera();
    c->set_rate(50);
    c->start();
    EXPECT_TRUE(c->differences().empty());
    EXPECT_TRUE(driver_.streaming);
    EXPECT_EQ(driver_.interval.denominator, 30U) << "left as it was";
  }
}

TEST_F(V4l2CameraTest, switches_every_automatic_control_off) {
  const std::map<uint32_t, int32_t> automatic = {
      {V4L2_CID_EXPOSURE_AUTO, V4L2_EXPOSURE_APERTURE_PRIORITY},
      {V4L2_CID_EXPOSURE_AUTO_PRIORITY, 1},
      {V4L2_CID_AUTOGAIN, 1},
      {V4L2_CID_AUTO_WHITE_BALANCE, 1},
      {V4L2_CID_FOCUS_AUTO, 1},
      {V4L2_CID_POWER_LINE_FREQUENCY, V4L2_CID_POWER_LINE_FREQUENCY_50HZ}};
  const auto c = camera();
  for (int opened = 0; opened < 2; ++opened) {  // another program may switch them on in between
    for (const auto& [id, value] : automatic) driver_.controls[id] = value;
    c->start();
    for (const auto& [id, value] : automatic) {
      EXPECT_EQ(driver_.controls[id], id == V4L2_CID_EXPOSURE_AUTO ? V4L2_EXPOSURE_MANUAL : 0)
          << std::hex << id;
    }
    EXPECT_TRUE(c->differences().empty());
    c->stop();
  }
}

TEST_F(V4l2CameraTest, warns_of_an_automatic_control_that_the_camera_ignores) {
  driver_.controls[V4L2_CID_AUTO_WHITE_BALANCE] = 1;
  driver_.controls[V4L2_CID_FOCUS_AUTO] = 1;
  driver_.fixed = {V4L2_CID_AUTO_WHITE_BALANCE};
  const auto c = camera();
  c->start();
  EXPECT_THAT(c->differences(),
              testing::ElementsAre(SettingDifference{"white_balance_automatic", "0", "1"}));
  EXPECT_EQ(driver_.controls[V4L2_CID_FOCUS_AUTO], 0);
  EXPECT_TRUE(driver_.streaming) << "the pulses of the frames are certain all the same";
}

TEST_F(V4l2CameraTest,
       lists_an_exposure_time_that_differs_and_warns_if_it_differs_by_over_a_tenth) {
  const auto differences = [this](double exposure_us) {
    settings_.exposure_us = exposure_us;
    const auto c = camera();
    c->start();
    return c->differences();
  };
  EXPECT_THAT(differences(1'000'000), testing::IsEmpty());
  EXPECT_THAT(differences(1950),
              testing::ElementsAre(SettingDifference{"exposure_us", "1950", "2000", true}));
  EXPECT_THAT(differences(250),
              testing::ElementsAre(SettingDifference{"exposure_us", "250", "300"}));
  driver_.controls[V4L2_CID_EXPOSURE_ABSOLUTE] = 9950;
  driver_.fixed = {V4L2_CID_EXPOSURE_ABSOLUTE};
  EXPECT_THAT(differences(1'000'000),
              testing::ElementsAre(SettingDifference{"exposure_us", "1000000", "995000", true}));
}

TEST_F(V4l2CameraTest, warns_of_an_exposure_time_that_the_camera_rounds_by_more_than_a_step) {
  driver_.fixed = {V4L2_CID_EXPOSURE_ABSOLUTE};
  for (const auto& [exposure_us, steps] :
       {std::pair(1200, 10), std::pair(1200, 24), std::pair(20'000, 110)}) {
    settings_.exposure_us = exposure_us;
    driver_.controls[V4L2_CID_EXPOSURE_ABSOLUTE] = steps;
    const auto rounding = camera();
    rounding->start();
    EXPECT_THAT(rounding->differences(),
                testing::ElementsAre(SettingDifference{"exposure_us", std::to_string(exposure_us),
                                                       std::to_string(100 * steps)}));
  }
  driver_.controls[V4L2_CID_EXPOSURE_ABSOLUTE] = 99;
  EXPECT_THAT(start_error(), HasSubstr("exposure_us: expected 20000, found 9900"));
}

TEST_F(V4l2CameraTest, rejects_an_exposure_time_far_below_the_steps_of_v4l2) {
  settings_.exposure_us = 20;
  EXPECT_THAT(start_error(),
              HasSubstr("exposure_us: expected 20, found 100; V4L2 counts in steps"));
}

TEST_F(V4l2CameraTest, takes_an_exposure_time_that_is_longer_than_the_interval_from_before) {
  driver_.interval_bounds_exposure = true;
  driver_.rates = {25, 60};
  settings_.exposure_us = 30'000;
  for (const bool is_triggered : {true, false}) {
    if (!is_triggered) settings_.trigger_control.reset();
    driver_.interval = {1, 60};
    driver_.controls[V4L2_CID_EXPOSURE_ABSOLUTE] = 100;
    const auto c = camera();
    c->set_rate(25);
    c->start();
    EXPECT_EQ(driver_.controls[V4L2_CID_EXPOSURE_ABSOLUTE], 300) << is_triggered;
    EXPECT_TRUE(c->differences().empty()) << is_triggered;
  }
}

TEST_F(V4l2CameraTest, writes_the_controls_of_the_studio_file_by_their_names) {
  driver_.controls[V4L2_CID_WHITE_BALANCE_TEMPERATURE] = 2800;
  settings_.features = {{"white_balance_temperature", "4600"}};
  const auto c = camera();
  c->start();
  EXPECT_EQ(driver_.controls[V4L2_CID_WHITE_BALANCE_TEMPERATURE], 4600);
  EXPECT_TRUE(c->differences().empty());
  driver_.fixed = {V4L2_CID_WHITE_BALANCE_TEMPERATURE};
  settings_.features = {{"white_balance_temperature", "5200"}};
  const auto stubborn = camera();
  stubborn->start();
  EXPECT_THAT(stubborn->differences(),
              testing::ElementsAre(SettingDifference{"white_balance_temperature", "5200", "4600"}));
  settings_.features = {{"white_balance", "4600"}};
  EXPECT_THAT(start_error(),
              HasSubstr("white_balance: expected 4600, found a camera without this"));
  settings_.features = {{"white_balance_temperature", "warm"}};
  EXPECT_THAT(start_error(), HasSubstr("expected a whole number, true or false, found warm"));
}

TEST_F(V4l2CameraTest, warns_of_a_control_without_a_value_unless_it_is_only_written) {
  driver_.controls[V4L2_CID_WHITE_BALANCE_TEMPERATURE] = 2800;
  driver_.controls.erase(V4L2_CID_EXPOSURE_ABSOLUTE);
  driver_.unreadable = {V4L2_CID_WHITE_BALANCE_TEMPERATURE};
  settings_.features = {{"white_balance_temperature", "4600"}};
  const auto silent = camera();
  silent->start();
  EXPECT_THAT(silent->differences(), testing::ElementsAre(SettingDifference{
                                         "white_balance_temperature", "4600", "no answer"}));
  silent->stop();
  driver_.control_flags = V4L2_CTRL_FLAG_WRITE_ONLY;
  const auto written = camera();
  written->start();
  EXPECT_EQ(driver_.controls[V4L2_CID_WHITE_BALANCE_TEMPERATURE], 4600);
  EXPECT_TRUE(written->differences().empty());
}

TEST_F(V4l2CameraTest, converts_yuyv_to_rgb_by_the_colour_space_of_the_driver) {
  settings_.pixel_format = {PixelFormat::kRGB8, PixelLayout::kYuyv};
  driver_.stride = 16;
  driver_.colorspace = V4L2_COLORSPACE_REC709;
  std::vector<uint8_t> red;
  for (int i = 0; i < 16; ++i) red.insert(red.end(), {63, 102, 63, 240});
  driver_.deliveries = {{.bytes = 64, .content = red}};
  const auto c = camera();
  c->start();
  EXPECT_EQ(driver_.format, V4L2_PIX_FMT_YUYV);
  EXPECT_EQ(c->format(), PixelFormat::kRGB8);
  const auto frame = c->wait({});
  ASSERT_TRUE(frame);
  ASSERT_EQ(frame->image.bytes.size(), 3U * 6 * 4);
  const uint8_t* pixel = frame->image.row(3) + size_t{3} * 5;
  EXPECT_GE(pixel[0], 252);
  EXPECT_LE(pixel[1], 3);
  EXPECT_LE(pixel[2], 3);
}

TEST_F(V4l2CameraTest, carries_12_bits_of_a_packed_bayer_format) {
  settings_.pixel_format = {PixelFormat::kBayerRG12, PixelLayout::kMipi};
  driver_.formats = {V4L2_PIX_FMT_SRGGB12P};
  driver_.stride = 10;
  driver_.deliveries = {{.bytes = 40, .content = {0xab, 0x12, 0x3c}}};
  const auto c = camera();
  c->start();
  EXPECT_EQ(c->format(), PixelFormat::kBayerRG12);
  const auto frame = c->wait({});
  ASSERT_TRUE(frame);
  EXPECT_EQ(frame->image.format, PixelFormat::kBayerRG12);
  EXPECT_EQ(frame->image.bytes[0] | frame->image.bytes[1] << 8, 0xabc);
  EXPECT_EQ(frame->image.bytes[2] | frame->image.bytes[3] << 8, 0x123);
}

TEST_F(V4l2CameraTest, rejects_a_width_that_splits_packed_samples) {
  settings_.pixel_format = {PixelFormat::kMono10, PixelLayout::kMipi};
  driver_.formats = {V4L2_PIX_FMT_Y10P};
  EXPECT_THAT(start_error(), HasSubstr("width: expected a multiple of 4, found 6"));
}

TEST_F(V4l2CameraTest, decodes_motion_jpeg_and_counts_a_cut_image_as_damaged) {
  settings_.pixel_format = {PixelFormat::kRGB8, PixelLayout::kJpeg};
  driver_.formats = {V4L2_PIX_FMT_MJPEG};
  driver_.stride = 0;
  Image grey({6, 4}, PixelFormat::kRGB8);
  std::fill(grey.bytes.begin(), grey.bytes.end(), uint8_t{90});
  const auto jpeg = encode_jpeg(grey.view(), 90);
  const auto bytes = static_cast<uint32_t>(jpeg.size());
  driver_.deliveries = {{.bytes = bytes - 20, .content = jpeg}, {.bytes = bytes, .content = jpeg}};
  const auto c = camera();
  c->start();
  const auto frame = c->wait({});
  ASSERT_TRUE(frame);
  EXPECT_EQ(frame->image.bytes, grey.bytes);
  EXPECT_EQ(c->statistics().damaged, 1);
}

TEST_F(V4l2CameraTest, names_the_camera_and_the_rejected_setting) {
  driver_.formats = {V4L2_PIX_FMT_YUYV, V4L2_PIX_FMT_MJPEG};
  EXPECT_THAT(start_error(),
              HasSubstr("cam07: pixel_format: expected Mono8, found YUYV; it has YUYV, MJPG"));
  driver_ = {};
  driver_.stores_controls = false;
  EXPECT_THAT(start_error(), HasSubstr("exposure_us: expected 2000, found 33300"));
  driver_ = {};
  driver_.controls.erase(kTrigger);
  EXPECT_THAT(start_error(),
              HasSubstr("trigger_control 0x009a0914: expected 3, found Invalid argument"));
  driver_ = {};
  driver_.clock = V4L2_BUF_FLAG_TIMESTAMP_UNKNOWN;
  EXPECT_THAT(start_error(), HasSubstr("time stamps: expected CLOCK_MONOTONIC"));
  driver_ = {};
  driver_.capabilities = V4L2_CAP_VIDEO_OUTPUT;
  EXPECT_THAT(start_error(), HasSubstr("a device that streams images"));
  driver_ = {};
  settings_.size = ImageSize{1024, 768};
  EXPECT_THAT(start_error(), HasSubstr("size: expected 1024x768, found 6x4"));
  EXPECT_EQ(driver_.open, 0) << "a rejected device is closed";
}

}  // namespace
}  // namespace v3d::capture
