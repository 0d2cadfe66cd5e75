#include "take/take_sound.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/core/error.h"
#include "support/message_of.h"
#include "support/sounding_take.h"
#include "support/temporary_folder.h"

namespace v3d::take {
namespace {

using testing::DoubleNear;
using testing::Each;
using testing::ElementsAre;
using testing::HasSubstr;

constexpr double kStep = test::kSoundingPulseRate / 48'000;

class TakeSoundTest : public testing::Test {
 protected:
  /// Pulse 0 is at sample 1000; the clock of the sound is 500 ppm fast.
  const sound::PulseMap map_{{{0, 1000}, {100, 1000 + 100 * 1920 * 1.0005}}};
  const test::TemporaryFolder folder_;
  const TakePaths take_{folder_ / "kendo-07"};
};

TEST_F(TakeSoundTest, plays_a_sample_at_the_pulse_that_the_map_states) {
  const double at = map_.sample_of(50);
  test::write_sounding_take(take_, map_, 200'000, 1, [&](int64_t sample, int) {
    return test::burst(static_cast<double>(sample), at - 96);
  });
  TakeSound sound(take_);
  EXPECT_FALSE(sound.is_silent());
  const auto heard = sound.read(49, kStep, 3840);
  EXPECT_THAT(test::centre_of_sound(heard), DoubleNear(1920, 0.1));
  EXPECT_THAT(test::centre_of_sound(heard, 1), DoubleNear(1920, 0.1)) << "on both sides";
}

TEST_F(TakeSoundTest, resamples_a_tone_to_the_clock_of_the_pulses) {
  constexpr double kHz = 5000;
  const auto tone = [&](double sample) {
    return 0.5 * std::sin(2 * std::numbers::pi * kHz * sample / 48'000);
  };
  test::write_sounding_take(take_, map_, 100'000, 1,
                            [&](int64_t sample, int) { return tone(static_cast<double>(sample)); });
  const auto heard = TakeSound(take_).read(10, kStep, 4800);
  for (size_t k = 0; k < 4800; ++k) {
    const double sample = map_.sample_of(10 + static_cast<double>(k) * kStep);
    ASSERT_NEAR(heard[2 * k], tone(sample), 1e-3) << k;
  }
}

TEST_F(TakeSoundTest, is_silent_before_and_after_the_file) {
  test::write_sounding_take(take_, map_, 10'000, 1, [](int64_t, int) { return 0.5; });
  TakeSound sound(take_);
  EXPECT_THAT(sound.read(-100, kStep, 100), Each(0.0F));
  EXPECT_THAT(sound.read(1e9, kStep, 100), Each(0.0F));
  EXPECT_THAT(sound.read(1, kStep, 100), Each(testing::FloatNear(0.5F, 1e-3F)));
}

TEST_F(TakeSoundTest, puts_odd_channels_left_and_even_ones_right) {
  test::write_sounding_take(take_, map_, 10'000, 2,
                            [](int64_t, int channel) { return 0.25 * channel; });
  const auto heard = TakeSound(take_).read(1, kStep, 1);
  EXPECT_THAT(heard,
              ElementsAre(testing::FloatNear(0.25F, 1e-3F), testing::FloatNear(0.5F, 1e-3F)));
}

TEST_F(TakeSoundTest, has_no_channel_of_pulses_or_timecode) {
  Studio studio;
  studio.sounds.push_back({.node = "cap01",
                           .device = "hw:0",
                           .channels = 4,
                           .pulse_channel = 2,
                           .timecode_channel = 3,
                           .timecode_rate = {}});
  const SoundLedger sound{.file = "sound/cap01.wav", .node = "cap01", .channels = 4};
  EXPECT_THAT(audible_channels(sound, studio), ElementsAre(1, 4));
  EXPECT_THAT(audible_channels(sound, std::nullopt), ElementsAre(1, 2, 3, 4));
}

TEST_F(TakeSoundTest, names_files_that_have_no_map) {
  test::write_sounding_take(take_, {}, 1000, 1, [](int64_t, int) { return 0; });
  const TakeSound sound(take_);
  EXPECT_TRUE(sound.is_silent());
  EXPECT_THAT(sound.files_without_map(), ElementsAre("sound/cap01.wav"));
}

TEST_F(TakeSoundTest, names_a_file_that_is_missing) {
  test::write_sounding_take(take_, map_, 1000, 1, [](int64_t, int) { return 0; });
  std::filesystem::remove(take_.sound() / "cap01.wav");
  EXPECT_THAT(test::message_of<InputError>([&] { TakeSound sound(take_); }),
              HasSubstr("sound/cap01.wav"));
}

TEST_F(TakeSoundTest, is_silent_for_a_take_without_a_ledger) {
  EXPECT_TRUE(TakeSound(take_).is_silent());
}

}  // namespace
}  // namespace v3d::take
