// Tests that SegmentedLog returns the masks of the live segmentation from a recorded take.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <map>
#include <random>

#include "base/core/error.h"
#include "daemon/recorded/take_frames.h"
#include "support/message_of.h"
#include "support/temporary_folder.h"
#include "support/unreadable_byte.h"

namespace v3d::ctl {
namespace {

constexpr ImageSize kSize{96, 64};
const std::string kCamera = "cam01";

/// Image of a wall in the light of this pulse, which gets brighter on the left, and a passing
/// person.
Image picture(int64_t pulse) {
  std::mt19937 random(static_cast<unsigned>(pulse));
  std::normal_distribution<double> noise(0, 1.5);
  Image image(kSize, PixelFormat::kMono8);
  const auto here = static_cast<int>(pulse % 70);
  for (int y = 0; y < kSize.height; ++y) {
    for (int x = 0; x < kSize.width; ++x) {
      const double wall = x < 30 ? 100 + 0.01 * static_cast<double>(pulse) : 100;
      const bool someone = x >= here && x < here + 20 && y > 10;
      image.row(y)[x] = static_cast<uint8_t>((someone ? 104 + x % 9 : wall) + noise(random));
    }
  }
  return image;
}

class SegmentedLogTest : public testing::Test {
 protected:
  SegmentedLogTest() {
    std::filesystem::create_directories(take_.background());
    model_ = {kSize, PixelFormat::kMono8, {}, {}};
    model_.mean.assign(kSize.pixels(), 100);
    model_.spread.assign(kSize.pixels(), 1.5);
    save_background(take_.background(), kCamera, model_);
  }

  static wire::FrameMessage message_of(int64_t pulse) {
    wire::FrameMessage message;
    message.frame.camera = kCamera;
    message.frame.label.pulse = pulse;
    message.frame.sensor_size = kSize;
    message.frame.roi = {0, 0, kSize.width, kSize.height};
    message.frame.image = picture(pulse);
    return message;
  }
  /// The error of reading a log with this frame.
  std::string error_of(const wire::FrameMessage& message) {
    {
      take::EventLogWriter log(take_.frames(kCamera));
      EXPECT_TRUE(log.write(message));
    }
    recorded::SegmentedLog log(take_, kCamera);
    return test::message_of<InputError>([&] { log.read(message.frame.label.pulse); });
  }

  /// Writes a log as a capture daemon does that sends every third pulse live. Keeps the masks of
  /// these pulses. `stored`: mask of every frame in the log.
  void record(const std::vector<int64_t>& pulses, const std::optional<Mask>& stored = {}) {
    segmentation::Segmenter segmenter(model_, {});
    take::EventLogWriter log(take_.frames(kCamera));
    for (const int64_t pulse : pulses) {
      wire::FrameMessage message = message_of(pulse);
      message.frame.mask = stored;
      ASSERT_TRUE(log.write(message));
      const bool learn = segmenter.learns_from(pulse);
      const bool live = pulse % 3 == 1;
      if (!live && !learn) continue;
      const ImageView image = message.frame.image.view();
      Mask mask = segmenter.segment(image);
      if (learn) segmenter.learn(pulse, image, mask);
      if (live) live_.emplace(pulse, std::move(mask));
    }
  }

  void expect_as_live(recorded::SegmentedLog& log, int64_t pulse) {
    const auto frame = log.read(pulse);
    ASSERT_TRUE(frame) << pulse;
    EXPECT_EQ(frame->mask, live_.at(pulse)) << pulse;
  }
  void expect_all_as_live() {
    recorded::SegmentedLog log(take_, kCamera);
    for (const auto& [pulse, mask] : live_) expect_as_live(log, pulse);
  }

  const test::TemporaryFolder folder_;
  const take::TakePaths take_{folder_.path()};
  segmentation::BackgroundModel model_;
  std::map<int64_t, Mask> live_;
};

std::vector<int64_t> pulses(int64_t begin, int64_t end) {
  std::vector<int64_t> all;
  for (int64_t pulse = begin; pulse < end; ++pulse) all.push_back(pulse);
  return all;
}

TEST_F(SegmentedLogTest, returns_the_live_masks) {
  record(pulses(0, 300));
  expect_all_as_live();
  segmentation::Segmenter unlearned(
      model_, {});  // without learning the masks differ, so the test is sensitive
  EXPECT_NE(unlearned.segment(picture(298).view()), live_.at(298));
}

TEST_F(SegmentedLogTest, returns_the_live_masks_for_a_part_and_for_reverse_order) {
  record(pulses(0, 300));
  recorded::SegmentedLog from_the_middle(take_, kCamera);
  for (const int64_t pulse : {202, 205, 256, 298}) expect_as_live(from_the_middle, pulse);
  recorded::SegmentedLog backwards(take_, kCamera);
  for (const int64_t pulse : {298, 100, 34, 31, 1, 298}) expect_as_live(backwards, pulse);
}

TEST_F(SegmentedLogTest, rejects_a_frame_of_another_camera) {
  wire::FrameMessage message = message_of(0);
  message.frame.camera = "cam02";
  EXPECT_EQ(error_of(message),
            take_.frames(kCamera).string() + ": has frames of 'cam02'; expected those of cam01");
}

TEST_F(SegmentedLogTest, rejects_a_cropped_frame) {
  wire::FrameMessage message = message_of(0);
  message.frame.roi = {0, 0, 32, 32};
  message.frame.image = Image({32, 32}, PixelFormat::kMono8);
  message.frame.mask = Mask(kSize);
  EXPECT_EQ(error_of(message), take_.frames(kCamera).string() +
                                   ": the frame of pulse 0 is cropped; expected whole images");
}

TEST_F(SegmentedLogTest, learns_again_in_reverse_order_only_before_a_frame_for_learning) {
  record(pulses(0, 300));
  recorded::SegmentedLog log(take_, kCamera);
  expect_as_live(log, 127);
  const test::UnreadableByte bad(3000, take_.folder);  // in the frame of pulse 0
  for (const int64_t pulse : {124, 118, 97, 127}) expect_as_live(log, pulse);
  EXPECT_TRUE(log.read_errors().empty());
  log.read(94);  // before the frame of pulse 96
  EXPECT_FALSE(log.read_errors().empty());
}

TEST_F(SegmentedLogTest, returns_the_live_masks_when_frames_for_learning_are_missing) {
  std::vector<int64_t> some;
  for (const int64_t pulse : pulses(10, 300)) {
    if (pulse != 64 && pulse != 96 && pulse % 7 != 0) some.push_back(pulse);
  }
  record(some);
  expect_all_as_live();
}

TEST_F(SegmentedLogTest, returns_the_live_masks_when_pulse_numbers_are_out_of_order) {
  record({0, 1, 64, 64, 4, 32, 34, 65, 64, 70, 160, 128, 130, 133, 100, 192, 193});
  recorded::SegmentedLog log(take_, kCamera);
  for (const int64_t pulse : {1, 4, 34, 70, 100, 130, 133, 193}) expect_as_live(log, pulse);
}

Mask some_mask() {
  Mask mask(kSize);
  for (int y = 5; y < 60; ++y) mask.fill_row(y, 3, 90);
  return mask;
}

TEST_F(SegmentedLogTest, returns_a_stored_mask_with_the_live_one_as_background_difference) {
  record(pulses(0, 300), some_mask());
  recorded::SegmentedLog log(take_, kCamera);
  for (const auto& [pulse, live] : live_) {
    const auto frame = log.read(pulse);
    ASSERT_TRUE(frame) << pulse;
    EXPECT_EQ(frame->mask, some_mask()) << pulse;
    EXPECT_EQ(frame->background_difference, live) << pulse;
  }
}

TEST_F(SegmentedLogTest, returns_a_segmented_mask_without_background_difference) {
  record({0});
  EXPECT_FALSE(recorded::SegmentedLog(take_, kCamera).read(0)->background_difference);
}

TEST_F(SegmentedLogTest, returns_a_stored_mask_alone_without_a_background_model_of_its_size) {
  record({0, 1, 32, 64}, some_mask());
  const auto expect_mask_alone = [&] {
    const auto frame = recorded::SegmentedLog(take_, kCamera).read(64);
    ASSERT_TRUE(frame);
    EXPECT_EQ(frame->mask, some_mask());
    EXPECT_FALSE(frame->background_difference);
  };
  segmentation::BackgroundModel wider{{98, 64}, PixelFormat::kMono8, {}, {}};
  wider.mean.assign(wider.size.pixels(), 100);
  wider.spread.assign(wider.size.pixels(), 1.5);
  save_background(take_.background(), kCamera, wider);
  expect_mask_alone();
  std::filesystem::remove_all(take_.background());
  expect_mask_alone();
}

TEST_F(SegmentedLogTest, passes_the_background_difference_to_the_reconstruction) {
  record({1}, some_mask());
  const recon::FrameSet set =
      recorded::observe_all(1, {recorded::SegmentedLog(take_, kCamera).read(1)});
  ASSERT_EQ(set.frames.size(), 1U);
  EXPECT_EQ(set.frames[0].mask, some_mask());
  EXPECT_EQ(set.frames[0].background_difference, live_.at(1));
}

TEST_F(SegmentedLogTest, does_not_follow_a_background_folder_that_is_a_link) {
  record({0});
  std::filesystem::rename(take_.background(), folder_ / "elsewhere");
  std::filesystem::create_directory_symlink("elsewhere", take_.background());
  EXPECT_THAT(test::message_of<InputError>([&] { recorded::SegmentedLog log(take_, kCamera); }),
              testing::HasSubstr("background: it is a symbolic link"));
}

}  // namespace
}  // namespace v3d::ctl
