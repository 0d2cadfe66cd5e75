// Tests of timecode that is put out in step with the pulses, in virtual time.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <random>

#include "sound/sound_track.h"
#include "sound/timecode.h"
#include "sound/timecode_clock.h"

namespace v3d::sound {
namespace {

using testing::Ge;
using testing::IsEmpty;

constexpr int kRate = 48'000;
constexpr double kPulseRate = 25;

MonotonicInstant instant(double t) { return from_ns<Monotonic>(std::llround((1000 + t) * 1e9)); }

/// A device that plays what LtcPlayer makes, and pulses, against a host.
struct VirtualOutput {
  TimecodeRate rate = TimecodeRate::k25;
  Timecode start{10, 0, 58, 0};
  double device_ppm = 80;    ///< the device's clock is fast by this
  double pulses_ppm = 0;     ///< the clock of the pulses is fast by this
  double jitter_s = 0.2e-3;  ///< mean lateness of time stamps
  double underrun_s = 0;     ///< the device has nothing to play once, at 10 s, for this time
  double seconds = 20;
  double first_pulse_s = 3;

  std::vector<float> signal{};   ///< as the device plays it
  std::vector<double> pulses{};  ///< host times
  TimecodeClock clock{rate, static_cast<double>(frame_number(start, rate)), instant(0)};

  double device_rate() const { return kRate * (1 + 1e-6 * device_ppm); }
  /// The host's time of a sample of `signal`.
  double time_of(double sample) const { return sample / device_rate(); }

  void run() {
    constexpr int64_t kBlock = 480, kBuffer = 9600;
    std::mt19937 random(3);
    std::exponential_distribution<double> late(1 / jitter_s);
    LtcPlayer player(kRate, rate);
    std::vector<float> queue;
    clock.begin_train(kPulseRate);
    const double period = 1 / kPulseRate / (1 + 1e-6 * pulses_ppm);
    int64_t played = 0;
    bool has_paused = underrun_s == 0;
    while (time_of(static_cast<double>(std::ssize(signal))) < seconds) {
      const double now = time_of(static_cast<double>(std::ssize(signal)));
      for (double at = first_pulse_s + period * static_cast<double>(pulses.size()); at <= now;
           at += period) {
        clock.add_pulse(std::ssize(pulses), instant(at + late(random) / 10));
        pulses.push_back(at);
      }
      if (!has_paused && now > 10) {
        has_paused = true;
        signal.insert(signal.end(), queue.begin(), queue.end());
        played += std::ssize(queue);
        queue.clear();
        signal.resize(signal.size() + static_cast<size_t>(underrun_s * kRate));
        player.add_underrun();
      }
      player.add_stamp(played, instant(now + late(random)));
      const auto made = player.next(kBuffer - std::ssize(queue), clock);
      queue.insert(queue.end(), made.begin(), made.end());
      signal.insert(signal.end(), queue.begin(), queue.begin() + kBlock);
      queue.erase(queue.begin(), queue.begin() + kBlock);
      played += kBlock;
    }
  }

  std::vector<LtcFrame> frames() const {
    LtcReader reader(kRate);
    return reader.push(signal);
  }
};

/// Distance of each frame that was read from the place where the clock has its number, frames.
std::vector<double> phase_errors(const VirtualOutput& output) {
  std::vector<double> errors;
  for (const LtcFrame& frame : output.frames()) {
    if (!is_valid(frame.timecode, output.rate)) continue;
    const double expected =
        output.clock.frames_at(instant(output.time_of(static_cast<double>(frame.sample))));
    errors.push_back(expected - static_cast<double>(frame_number(frame.timecode, output.rate)));
  }
  return errors;
}

class LtcPlayerTest : public testing::TestWithParam<TimecodeRate> {};

TEST_P(LtcPlayerTest, puts_each_frame_out_when_the_clock_has_its_number) {
  VirtualOutput output{.rate = GetParam()};
  output.run();
  const auto errors = phase_errors(output);
  ASSERT_THAT(errors.size(), Ge(static_cast<size_t>(19 * frames_per_second(GetParam()))));
  for (const double error : errors) EXPECT_NEAR(error, 0, 0.05);
  RecordProperty("largest_error_frames",
                 std::to_string(std::max(std::ranges::max(errors), -std::ranges::min(errors))));
  for (const LtcFrame& frame : output.frames()) {
    EXPECT_TRUE(is_valid(frame.timecode, GetParam()));
    EXPECT_EQ(frame.is_drop, GetParam() == TimecodeRate::k2997Drop);
  }
}

/// The recorder hears the output in its timecode channel, and the pulses at their times.
TEST_P(LtcPlayerTest, gives_each_pulse_the_timecode_that_was_put_out_for_it) {
  VirtualOutput output{.rate = GetParam(), .pulses_ppm = -40};
  output.run();
  SoundTrack track({.sound = {.node = "cap01",
                              .device = "loop",
                              .channels = 1,
                              .timecode_channel = 1,
                              .timecode_rate = {}},
                    .pulse_rate_hz = kPulseRate,
                    .stamp_uncertainty_s = 0});
  size_t pulse = 0;
  for (int64_t at = 0; at + 480 <= std::ssize(output.signal); at += 480) {
    SoundBlock block{.position = at};
    for (int64_t i = at; i < at + 480; ++i) {
      block.values.push_back(static_cast<int32_t>(output.signal[static_cast<size_t>(i)] * 2e9F));
    }
    const double end = output.time_of(static_cast<double>(at + 480));
    block.at = instant(end);
    for (; pulse < output.pulses.size() && output.pulses[pulse] < end; ++pulse) {
      track.add_pulse(static_cast<int64_t>(pulse), instant(output.pulses[pulse]));
    }
    track.add(block);
  }
  track.finish();
  ASSERT_TRUE(track.timecode());
  ASSERT_EQ(track.timecode()->rate(), GetParam());
  EXPECT_EQ(track.timecode()->jumps(), 0);
  const PulseMap map = track.pulses().map;
  ASSERT_TRUE(map.is_known());
  for (size_t n = 0; n < output.pulses.size(); ++n) {
    const double frames = output.clock.frames_at(instant(output.pulses[n]));
    const auto read = timecode_frames_at(track.timecode()->runs(), GetParam(), kRate,
                                         map.sample_of(static_cast<double>(n)));
    ASSERT_TRUE(read) << n;
    EXPECT_NEAR(*read, frames, 0.1) << n;
  }
}

INSTANTIATE_TEST_SUITE_P(Rates, LtcPlayerTest, testing::ValuesIn(kTimecodeRates),
                         [](const auto& rate) {
                           std::string text(name(rate.param));
                           std::erase(text, '.');
                           return text;
                         });

TEST(LtcPlayer, is_right_again_after_an_underrun) {
  VirtualOutput output{.underrun_s = 0.3};
  output.run();
  const auto errors = phase_errors(output);
  ASSERT_THAT(errors.size(), Ge(18U * 25U));
  for (const double error : errors) EXPECT_NEAR(error, 0, 0.05);
}

TEST(LtcPlayer, is_silent_until_the_clock_of_the_device_is_known) {
  LtcPlayer player(kRate, TimecodeRate::k25);
  EXPECT_THAT(player.next(4800, {TimecodeRate::k25, 0, instant(0)}), testing::Each(0.0F));
}

TEST(TimecodeClock, counts_on_the_clock_of_the_pulses_in_a_train) {
  TimecodeClock clock(TimecodeRate::k25, 100, instant(0));
  clock.begin_train(kPulseRate);
  constexpr double kPeriod = 0.04 * (1 + 100e-6);  // the pulses are slow by 100 ppm
  for (int64_t n = 0; n < 25'000; ++n) {
    clock.add_pulse(n, instant(10 + static_cast<double>(n) * kPeriod));
  }
  const double first = clock.frames_at(instant(10));
  EXPECT_NEAR(first, 350, 0.01);
  const double last = clock.frames_at(instant(10 + 24'999 * kPeriod));
  EXPECT_NEAR(last - first, 24'999, 0.01) << "one frame for each pulse";
}

TEST(TimecodeClock, keeps_the_timecode_of_the_first_pulse_when_the_clock_of_the_host_is_slewed) {
  TimecodeClock clock(TimecodeRate::k25, 100, instant(0));
  clock.begin_train(kPulseRate);
  double at = 10;
  clock.add_pulse(0, instant(at));
  const double first = clock.frames_at(instant(10));
  constexpr int64_t kPulses = 25'000;
  for (int64_t n = 1; n < kPulses; ++n) {
    at += 0.04 * (n < kPulses / 2 ? 1 + 100e-6 : 1);  // 50 ms in all
    clock.add_pulse(n, instant(at));
  }
  EXPECT_NEAR(clock.frames_at(instant(10)), first, 0.01);
  EXPECT_NEAR(clock.frames_at(instant(at)) - first, kPulses - 1, 0.01);
}

TEST(TimecodeClock, never_jumps_and_returns_to_the_clock_of_the_host) {
  TimecodeClock clock(TimecodeRate::k25, 0, instant(0));
  clock.begin_train(kPulseRate);
  constexpr double kPeriod = 0.04 * (1 + 100e-6);
  for (int64_t n = 0; n < 25'000; ++n) {
    clock.add_pulse(n, instant(static_cast<double>(n) * kPeriod));
  }
  double before = clock.frames_at(instant(990));
  for (int ms = 990'010; ms <= 1'200'000; ms += 10) {
    const double now = clock.frames_at(instant(ms / 1000.0));
    EXPECT_NEAR(now - before, 0.25, 0.001) << ms;
    before = now;
  }
  EXPECT_NEAR(before, 25 * 1200, 0.01);
}

}  // namespace
}  // namespace v3d::sound
