#include "v3dctl/takes/clap.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>

#include "base/core/error.h"
#include "support/sounding_take.h"
#include "support/temporary_folder.h"
#include "take/logs/frame_log.h"

namespace v3d::ctl {
namespace {

using testing::DoubleNear;

constexpr int64_t kPulses = 60;
constexpr ImageSize kSize{128, 96};

/// Two bars that approach each other by 1.5 pixels a pulse, and touch at `contact`.
Image bars_at(double pulse, double contact) {
  Image image(kSize, PixelFormat::kMono8);
  const double distance = 1.5 * std::max(0.0, contact - std::max(pulse, contact - 15));
  for (int y = 20; y < 76; ++y) {
    for (int x = 0; x < kSize.width; ++x) {
      const double beside = std::abs(x - 64.0) - distance;  // the inner edge of a bar
      const double share = std::clamp(beside + 0.5, 0.0, 1.0) * std::clamp(40 - beside, 0.0, 1.0);
      image.row(y)[x] = static_cast<uint8_t>(std::lround(20 + 200 * share));
    }
  }
  return image;
}

class TakeClapTest : public testing::Test {
 protected:
  /// `sound`, `picture`: pulse of the clap.
  void write_take(double sound, double picture) const {
    const sound::PulseMap map{{{0, 2400}, {kPulses, 2400 + kPulses * 1920.0}}};
    test::write_sounding_take(take_, map, 130'000, 1, [&](int64_t sample, int) {
      return test::burst(static_cast<double>(sample), map.sample_of(sound));
    });
    take::TakeInfo info = test::begun_take({"cam01"});
    info.pulses = kPulses;
    io::throw_if_failed(save_take_info(take_, info));
    take::EventLogWriter log(take_.frames("cam01"));
    for (int64_t pulse = 0; pulse < kPulses; ++pulse) {
      wire::FrameMessage message;
      message.frame.camera = "cam01";
      message.frame.label.pulse = pulse;
      message.frame.sensor_size = kSize;
      message.frame.roi = {0, 0, kSize.width, kSize.height};
      message.frame.image = bars_at(static_cast<double>(pulse), picture);
      io::throw_if_failed(log.write(message));
    }
  }

  const test::TemporaryFolder folder_;
  const take::TakePaths take_{folder_ / "kendo-07"};
};

TEST_F(TakeClapTest, reports_how_much_later_the_sound_is_than_the_pictures) {
  for (const double late : {0.0, 1.5, -2.0}) {
    std::filesystem::remove_all(take_.folder);
    write_take(30.3 + late, 30.3);
    const auto clap = find_take_clap(take_);
    ASSERT_TRUE(clap) << late;
    EXPECT_THAT(clap->sound_pulse, DoubleNear(30.3 + late, 0.05));
    ASSERT_EQ(clap->cameras.size(), 1U) << late;
    EXPECT_THAT(clap->offset_s(), DoubleNear(late / 25, clap->uncertainty_s())) << late;
  }
}

TEST_F(TakeClapTest, has_no_offset_when_nothing_moves) {
  write_take(30, 1000);
  const auto clap = find_take_clap(take_);
  ASSERT_TRUE(clap);
  EXPECT_TRUE(clap->cameras.empty());
}

TEST_F(TakeClapTest, is_rejected_for_a_take_without_sound) {
  std::filesystem::create_directories(take_.folder);
  io::throw_if_failed(save_take_info(take_, test::begun_take({})));
  EXPECT_THROW(find_take_clap(take_), InputError);
}

}  // namespace
}  // namespace v3d::ctl
