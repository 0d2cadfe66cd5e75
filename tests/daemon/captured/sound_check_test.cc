#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <functional>

#include "daemon/captured/sound_receiver.h"
#include "support/sounding_take.h"

namespace v3d::captured {
namespace {

using testing::DoubleNear;
using testing::HasSubstr;
using testing::Lt;

constexpr int kRate = 48'000;
constexpr int64_t kBlock = 480;
constexpr double kPulseRate = 25;
constexpr int64_t kPulses = 50;
const MonotonicInstant kBegin = from_ns<Monotonic>(5'000'000'000);

/// The sample at a pulse: the train begins a second after the sound.
double sample_of(double pulse) { return kRate + pulse * kRate / kPulseRate; }
MonotonicInstant time_of(double sample) { return kBegin + from_seconds(sample / kRate); }

/// Two channels, the second with the timecode.
StudioSound input() {
  return {.node = "cap01", .device = "hw:0", .timecode_channel = 2, .timecode_rate = {}};
}

/// Result of a check of 4 s of sound in which the first channel has `signal`, of samples.
CheckedSound checked_sound(const std::function<double(int64_t)>& signal, int64_t pulses = kPulses) {
  auto queue = std::make_shared<SoundQueue>(1000);
  SoundCheck check({.sound = input(), .pulse_rate_hz = kPulseRate}, queue);
  // The pulses come before their sound, as in a studio.
  int64_t next_pulse = 0;
  for (int64_t begin = 0; begin < 4 * kRate; begin += kBlock) {
    const auto end = static_cast<double>(begin + kBlock);
    for (; next_pulse < pulses && sample_of(static_cast<double>(next_pulse)) < end; ++next_pulse) {
      check.pulse_at({.pulse = next_pulse, .at = time_of(sample_of(next_pulse))});
    }
    sound::SoundBlock block{.position = begin, .at = time_of(end)};
    for (int64_t sample = begin; sample < begin + kBlock; ++sample) {
      block.values.push_back(static_cast<int32_t>(std::lround(signal(sample) * 2147483392.0)));
      block.values.push_back(static_cast<int32_t>(sample % 97) << 24);
    }
    queue->push(std::move(block));
  }
  return check.close();
}

TEST(SoundCheck, gives_the_pulse_of_a_clap) {
  const CheckedSound checked = checked_sound(
      [](int64_t sample) { return test::burst(static_cast<double>(sample), sample_of(20.4)); });
  EXPECT_EQ(checked.fault, "");
  ASSERT_TRUE(checked.clap_pulse);
  EXPECT_THAT(*checked.clap_pulse, DoubleNear(20.4, 0.05));
  EXPECT_THAT(checked.uncertainty_s, Lt(0.002));
}

TEST(SoundCheck, finds_no_clap_in_silence_and_in_a_steady_tone) {
  for (const double level : {0.0, 0.3}) {
    const CheckedSound checked = checked_sound(
        [&](int64_t sample) { return level * std::sin(0.05 * static_cast<double>(sample)); });
    EXPECT_EQ(checked.fault, "") << level;
    EXPECT_EQ(checked.clap_pulse, std::nullopt) << level;
  }
}

TEST(SoundCheck, ignores_a_louder_noise_before_the_first_pulse) {
  const CheckedSound checked = checked_sound([](int64_t sample) {
    const auto at = static_cast<double>(sample);
    return test::burst(at, 0.5 * kRate) + 0.3 * test::burst(at, sample_of(20.4));
  });
  ASSERT_TRUE(checked.clap_pulse);
  EXPECT_THAT(*checked.clap_pulse, DoubleNear(20.4, 0.05));
}

TEST(SoundCheck, names_the_fault_when_no_pulse_or_no_sound_came) {
  EXPECT_THAT(checked_sound([](int64_t) { return 0.0; }, 0).fault, HasSubstr("no pulse"));
  SoundCheck check({.sound = input(), .pulse_rate_hz = kPulseRate},
                   std::make_shared<SoundQueue>(10));
  EXPECT_EQ(check.close().fault, "no sound came from hw:0");
}

}  // namespace
}  // namespace v3d::captured
