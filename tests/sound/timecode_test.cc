#include "sound/timecode.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

#include <algorithm>
#include <cmath>
#include <random>

#include "pulse_signal.h"
#include "sound/ltc.h"

namespace v3d::sound {
namespace {

using testing::Ge;
using testing::IsEmpty;
using testing::Optional;

constexpr int kRate = 48'000;

/// Four seconds of LTC at `speed` times its speed.
std::vector<float> ltc_signal(TimecodeRate rate, const Timecode& start, double speed,
                              int frames = 100) {
  LtcWriter writer(kRate / speed, rate, start);
  std::vector<float> signal;
  for (int i = 0; i < frames; ++i) {
    const auto frame = writer.next();
    signal.insert(signal.end(), frame.begin(), frame.end());
  }
  return signal;
}

std::vector<LtcFrame> read(const std::vector<float>& signal) {
  LtcReader reader(kRate);
  std::vector<LtcFrame> frames;
  for (size_t at = 0; at < signal.size(); at += 480) {
    const auto found =
        reader.push(std::span(signal).subspan(at, std::min<size_t>(480, signal.size() - at)));
    frames.insert(frames.end(), found.begin(), found.end());
  }
  return frames;
}

TEST(Timecode, of_each_rate_is_read_at_a_quarter_to_four_times_its_speed) {
  for (const TimecodeRate rate : kTimecodeRates) {
    for (const double speed : {0.25, 0.5, 1.0, 2.0, 4.0}) {
      SCOPED_TRACE(std::string(name(rate)) + " at " + std::to_string(speed));
      const Timecode start{10, 59, 58, 20};
      const int64_t first = frame_number(start, rate);
      const auto frames = read(ltc_signal(rate, start, speed));
      ASSERT_THAT(frames.size(), Ge(95U));
      for (const LtcFrame& frame : frames) {
        ASSERT_TRUE(is_valid(frame.timecode, rate));
        EXPECT_EQ(frame.is_drop, rate == TimecodeRate::k2997Drop);
        const double length = kRate / speed / frames_per_second(rate);
        const auto number = static_cast<double>(frame_number(frame.timecode, rate) - first);
        EXPECT_NEAR(static_cast<double>(frame.sample), number * length, 0.1 * length);
      }
    }
  }
}

TEST(Timecode, of_each_rate_is_read_backwards) {
  for (const TimecodeRate rate : kTimecodeRates) {
    for (const double speed : {0.25, 1.0, 4.0}) {
      SCOPED_TRACE(std::string(name(rate)) + " at " + std::to_string(speed));
      const Timecode start{10, 59, 58, 20};
      const int64_t first = frame_number(start, rate);
      auto signal = ltc_signal(rate, start, speed);
      std::ranges::reverse(signal);
      const auto frames = read(signal);
      ASSERT_THAT(frames.size(), Ge(95U));
      for (const LtcFrame& frame : frames) {
        ASSERT_TRUE(is_valid(frame.timecode, rate));
        EXPECT_TRUE(frame.is_reverse);
        const double length = kRate / speed / frames_per_second(rate);
        const auto number = static_cast<double>(frame_number(frame.timecode, rate) - first);
        const double begin = static_cast<double>(signal.size()) - (number + 1) * length;
        EXPECT_NEAR(static_cast<double>(frame.sample), begin, 0.1 * length);
      }
    }
  }
}

TEST(Timecode, is_read_with_noise_30_db_below_it_and_at_a_low_level) {
  std::mt19937 random(3);
  for (const TimecodeRate rate : kTimecodeRates) {
    for (const auto& [gain, speed] :
         {std::pair(1.0F, 0.25), std::pair(1.0F, 1.0), std::pair(1.0F, 4.0), std::pair(0.01F, 0.25),
          std::pair(0.01F, 1.0), std::pair(0.01F, 4.0)}) {
      SCOPED_TRACE(std::string(name(rate)) + " at " + std::to_string(speed));
      auto signal = ltc_signal(rate, {1, 2, 3, 4}, speed);
      double power = 0;
      for (const float value : signal) power += value * value;
      const double level = std::sqrt(power / static_cast<double>(signal.size()));
      test::add_noise(signal, level * std::pow(10, -30.0 / 20), random);
      for (float& value : signal) value *= gain;
      const auto frames = read(signal);
      EXPECT_THAT(frames.size(), Ge(95U));
      const int64_t first = frame_number({1, 2, 3, 4}, rate);
      const double length = kRate / frames_per_second(rate);
      for (const LtcFrame& frame : frames) {
        ASSERT_TRUE(is_valid(frame.timecode, rate));
        const auto number = static_cast<double>(frame_number(frame.timecode, rate) - first);
        EXPECT_NEAR(static_cast<double>(frame.sample) * speed / length, number, 0.1);
      }
    }
  }
}

TEST(Timecode, is_not_found_in_silence_or_noise) {
  std::vector<float> signal(5 * kRate);
  EXPECT_THAT(read(signal), IsEmpty());
  std::mt19937 random(4);
  test::add_noise(signal, 0.1, random);
  EXPECT_THAT(read(signal), IsEmpty());
}

TEST(Timecode, drops_two_numbers_in_each_minute_but_every_tenth) {
  const auto next = [](const Timecode& t) {
    return timecode_of(frame_number(t, TimecodeRate::k2997Drop) + 1, TimecodeRate::k2997Drop);
  };
  EXPECT_EQ(next({1, 0, 59, 29}), (Timecode{1, 1, 0, 2}));
  EXPECT_EQ(next({1, 9, 59, 29}), (Timecode{1, 10, 0, 0}));
  EXPECT_EQ(next({23, 59, 59, 29}), (Timecode{0, 0, 0, 0}));
  EXPECT_FALSE(is_valid({1, 1, 0, 1}, TimecodeRate::k2997Drop));
  EXPECT_TRUE(is_valid({1, 10, 0, 1}, TimecodeRate::k2997Drop));
}

TEST(Timecode, with_dropped_numbers_is_within_a_tenth_of_a_second_of_the_clock_all_day) {
  for (int minute = 0; minute < 24 * 60; minute += 7) {
    const Timecode t = timecode_of_day(60.0 * minute + 30, TimecodeRate::k2997Drop);
    const double shown = (t.hours * 60 + t.minutes) * 60 + t.seconds + t.frames / 29.97;
    EXPECT_NEAR(shown, 60.0 * minute + 30, 0.1 + 2.0 / 30);
  }
}

TEST(Timecode, of_the_day_counts_from_midnight) {
  EXPECT_EQ(timecode_of_day(15 * 3600 + 4 * 60 + 5.5, TimecodeRate::k24), (Timecode{15, 4, 5, 12}));
}

RC_GTEST_PROP(TimecodeProperty, frame_numbers_and_timecodes_are_one_to_one, ()) {
  const auto rate = *rc::gen::elementOf(kTimecodeRates);
  const int64_t number = *rc::gen::inRange<int64_t>(0, frames_per_day(rate));
  const Timecode timecode = timecode_of(number, rate);
  RC_ASSERT(is_valid(timecode, rate));
  RC_ASSERT(frame_number(timecode, rate) == number);
  RC_ASSERT(timecode_of(number - frames_per_day(rate), rate) == timecode);
  RC_ASSERT(parse_timecode(timecode_text(timecode, rate), rate) == timecode);
}

RC_GTEST_PROP(TimecodeProperty, later_frames_have_later_timecodes, ()) {
  const auto rate = *rc::gen::elementOf(kTimecodeRates);
  const int64_t number = *rc::gen::inRange<int64_t>(0, frames_per_day(rate) - 1);
  RC_ASSERT(timecode_text(timecode_of(number, rate), rate) <
            timecode_text(timecode_of(number + 1, rate), rate));
}

RC_GTEST_PROP(TimecodeProperty, texts_of_other_kinds_are_rejected, (const std::string& text)) {
  const auto parsed = parse_timecode(text, TimecodeRate::k25);
  if (parsed) RC_ASSERT(timecode_text(*parsed, TimecodeRate::k25) == text);
}

// --- track ---

TimecodeTrack track_of(const std::vector<float>& signal,
                       std::optional<TimecodeRate> rate = std::nullopt) {
  TimecodeTrack track(kRate, rate);
  for (const LtcFrame& frame : read(signal)) track.add(frame);
  return track;
}

TEST(TimecodeTrack, finds_the_rate_and_the_timecode_of_any_position) {
  for (const TimecodeRate rate : kTimecodeRates) {
    SCOPED_TRACE(name(rate));
    const Timecode start{10, 59, 58, 20};
    const TimecodeTrack track = track_of(ltc_signal(rate, start, 1));
    ASSERT_THAT(track.rate(), Optional(rate));
    EXPECT_EQ(track.jumps(), 0);
    for (const int64_t frame : {0, 1, 50, 99, 110}) {
      const double middle = (static_cast<double>(frame) + 0.5) * kRate / frames_per_second(rate);
      EXPECT_THAT(track.at(middle), Optional(timecode_of(frame_number(start, rate) + frame, rate)));
    }
    EXPECT_EQ(track.at(10.0 * kRate), std::nullopt) << "no timecode is far from LTC";
  }
}

TEST(TimecodeTrack, that_runs_backwards_has_the_timecode_of_any_position) {
  for (const TimecodeRate rate : kTimecodeRates) {
    SCOPED_TRACE(name(rate));
    const Timecode start{10, 59, 58, 20};
    auto signal = ltc_signal(rate, start, 1);
    std::ranges::reverse(signal);
    const TimecodeTrack track = track_of(signal);
    ASSERT_THAT(track.rate(), Optional(rate));
    EXPECT_EQ(track.jumps(), 0);
    const auto end = static_cast<double>(signal.size());
    for (const int64_t frame : {90, 50, 10}) {
      for (const double part : {0.1, 0.5, 0.9}) {
        const double length = kRate / frames_per_second(rate);
        EXPECT_THAT(track.at(end - (static_cast<double>(frame) + part) * length),
                    Optional(timecode_of(frame_number(start, rate) + frame, rate)));
      }
    }
  }
}

TEST(TimecodeTrack, of_another_speed_requires_the_rate) {
  const TimecodeTrack track =
      track_of(ltc_signal(TimecodeRate::k25, {1, 0, 0, 0}, 2), TimecodeRate::k25);
  EXPECT_THAT(track.at(50.5 * 960), Optional(Timecode{1, 0, 2, 0}));
}

TEST(TimecodeTrack, reports_jumps_and_has_the_timecode_on_both_sides) {
  auto signal = ltc_signal(TimecodeRate::k25, {1, 0, 0, 0}, 1, 50);
  const auto later = ltc_signal(TimecodeRate::k25, {2, 0, 0, 0}, 1, 50);
  signal.insert(signal.end(), later.begin(), later.end());
  const TimecodeTrack track = track_of(signal);
  EXPECT_EQ(track.jumps(), 1);
  EXPECT_THAT(track.at(40.5 * 1920), Optional(Timecode{1, 0, 1, 15}));
  EXPECT_THAT(track.at(60.5 * 1920), Optional(Timecode{2, 0, 0, 10}));
}

/// `frames` frames from each of two starts, cut `cut` frames into the second part.
std::vector<float> jumping_signal(TimecodeRate rate, const Timecode& first, const Timecode& second,
                                  double cut) {
  auto signal = ltc_signal(rate, first, 1, 50);
  const auto later = ltc_signal(rate, second, 1, 60);
  const auto begin = std::llround(cut * kRate / frames_per_second(rate));
  signal.insert(signal.end(), later.begin() + begin, later.end());
  return signal;
}

TEST(TimecodeTrack, counts_a_jump_once_at_every_rate_wherever_the_signal_is_cut) {
  for (const TimecodeRate rate : kTimecodeRates) {
    for (const Timecode later : {Timecode{2, 0, 0, 10}, Timecode{0, 59, 0, 10}}) {
      for (const double cut : {0.0, 0.1, 0.35, 0.5, 0.8, 0.95}) {
        SCOPED_TRACE(std::string(name(rate)) + " cut at " + std::to_string(cut));
        const Timecode first{1, 0, 0, 0};
        const auto track = track_of(jumping_signal(rate, first, later, cut));
        ASSERT_THAT(track.rate(), Optional(rate));
        EXPECT_EQ(track.jumps(), 1);
        ASSERT_TRUE(track.first_jump());
        const TimecodeJump& jump = *track.first_jump();
        EXPECT_NEAR(jump.sample, 50.0 * kRate / frames_per_second(rate), kRate / 6);
        EXPECT_NEAR(static_cast<double>(jump.expected - frame_number(first, rate)), 51, 3);
        EXPECT_NEAR(static_cast<double>(jump.found - frame_number(later, rate)), 2, 3);
      }
    }
  }
}

TEST(TimecodeTrack, counts_one_frame_that_is_left_out_or_repeated_as_a_jump) {
  for (const TimecodeRate rate : kTimecodeRates) {
    const int64_t next = frame_number({1, 0, 0, 0}, rate) + 50;
    for (const int64_t error : {-1, 1}) {
      const auto track =
          track_of(jumping_signal(rate, {1, 0, 0, 0}, timecode_of(next + error, rate), 0));
      EXPECT_EQ(track.jumps(), 1) << name(rate);
    }
  }
}

TEST(TimecodeTrack, passes_dropped_numbers_without_a_jump) {
  for (const Timecode start : {Timecode{1, 0, 58, 0}, Timecode{1, 9, 58, 0}}) {
    const auto track = track_of(ltc_signal(TimecodeRate::k2997Drop, start, 1, 120));
    ASSERT_THAT(track.rate(), Optional(TimecodeRate::k2997Drop));
    EXPECT_EQ(track.frames(), 118) << "both sides of the minute were read";
    EXPECT_EQ(track.jumps(), 0);
    EXPECT_EQ(track.runs().size(), 1U);
  }
}

TEST(TimecodeTrack, continues_after_a_gap_without_a_jump_where_the_timecode_is_right) {
  for (const TimecodeRate rate : kTimecodeRates) {
    auto signal = ltc_signal(rate, {1, 0, 58, 0}, 1, 200);
    std::fill(signal.begin() + kRate, signal.begin() + 3 * kRate, 0.0F);
    const auto track = track_of(signal);
    EXPECT_EQ(track.jumps(), 0) << name(rate);
    EXPECT_EQ(track.runs().size(), 2U);
  }
}

TEST(TimecodeTrack, ignores_a_frame_that_is_damaged) {
  TimecodeTrack track(kRate, TimecodeRate::k25);
  for (int i = 0; i < 100; ++i) {
    Timecode timecode = timecode_of(i, TimecodeRate::k25);
    if (i == 50) timecode.seconds = 75;
    track.add({.timecode = timecode, .sample = i * 1920, .samples = 1920});
  }
  EXPECT_EQ(track.jumps(), 0);
}

TEST(TimecodeTrack, passes_midnight_without_a_jump) {
  const TimecodeTrack track = track_of(ltc_signal(TimecodeRate::k30, {23, 59, 58, 0}, 1, 120));
  EXPECT_EQ(track.jumps(), 0);
  EXPECT_THAT(track.at(90.5 * 1600), Optional(Timecode{0, 0, 1, 0}));
}

TEST(TimecodeTrack, is_bounded_when_the_timecode_jumps_at_every_frame) {
  TimecodeTrack track(kRate, TimecodeRate::k25);
  for (int i = 0; i < 10'000; ++i) {
    track.add(
        {.timecode = timecode_of(i * 7, TimecodeRate::k25), .sample = i * 1920, .samples = 1920});
  }
  EXPECT_EQ(track.jumps(), 1) << "frames of which none follows are one place";
  EXPECT_THAT(track.at(100.5 * 1920), Optional(timecode_of(700, TimecodeRate::k25)));
}

}  // namespace
}  // namespace v3d::sound
