#include "capture/sync/pulse_matcher.h"

#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

#include <cmath>
#include <random>
#include <vector>

namespace v3d::capture {
namespace {

constexpr Duration kPeriod = std::chrono::milliseconds(40);

DeviceInstant at(double pulses, double ppm = 0) {
  return from_ns<DeviceClock>(1'000'000'000 + std::llround(pulses * 40e6 * (1 + ppm * 1e-6)));
}

/// A frame that arrives `late` periods after the usual latency.
FrameStamp frame(double pulses, uint64_t counter, double late = 0) {
  return {at(pulses), counter, from_ns<Monotonic>(std::llround((pulses + late) * 40e6))};
}

PulseMatcher running() {
  PulseMatcher matcher(kPeriod);
  for (int k = 0; k < 10; ++k) matcher.label(frame(k, 100 + k));
  return matcher;
}

TEST(PulseMatcher, labels_the_first_frame_as_pulse_0) {
  PulseMatcher matcher(kPeriod);
  const PulseMatch match = matcher.label(frame(1234.5, 77));
  EXPECT_EQ(match.pulse, 0);
  EXPECT_FALSE(match.suspect);
}

TEST(PulseMatcher, counts_from_the_first_pulse_and_suspects_all_frames_if_it_is_uncertain) {
  for (const bool certain : {true, false}) {
    PulseMatcher matcher(kPeriod);
    matcher.begin(3, certain);
    for (int k = 3; k < 100; ++k) {
      const PulseMatch match = matcher.label(frame(k, 100 + k));
      EXPECT_EQ(match.pulse, k);
      EXPECT_EQ(match.suspect, !certain);
    }
  }
}

TEST(PulseMatcher, skips_the_pulse_of_a_frame_lost_in_transport) {
  PulseMatcher matcher = running();
  const PulseMatch match = matcher.label(frame(12, 112));
  EXPECT_EQ(match.pulse, 12);
  EXPECT_FALSE(match.suspect);
}

TEST(PulseMatcher, suspects_the_frame_after_a_missed_trigger) {
  PulseMatcher matcher = running();
  const PulseMatch match = matcher.label(frame(11, 110));
  EXPECT_EQ(match.pulse, 11);
  EXPECT_TRUE(match.suspect);
}

TEST(PulseMatcher, suspects_an_exposure_between_two_pulses) {
  PulseMatcher matcher = running();
  EXPECT_TRUE(matcher.label(frame(10.4, 110)).suspect);
  EXPECT_TRUE(matcher.label(frame(11, 112)).pulse == 11);
}

TEST(PulseMatcher, suspects_an_exposure_a_quarter_of_a_period_before_its_pulse) {
  PulseMatcher matcher = running();
  EXPECT_TRUE(matcher.label(frame(9.76, 110)).suspect);
}

TEST(PulseMatcher, suspects_a_restarted_camera_that_repeats_its_clock_and_counter) {
  PulseMatcher matcher = running();
  EXPECT_TRUE(matcher.label({at(0), 100, frame(40, 0).received}).suspect);
  // A duplicate or late frame by clock and counter, but the arrival is too late for that.
  EXPECT_TRUE(matcher.label({at(15), 115, frame(55, 0).received}).suspect);
}

TEST(PulseMatcher, suspects_a_restarted_clock_that_matches_by_chance_later) {
  PulseMatcher matcher = running();
  matcher.reopened();
  // The clock is one period ahead, and the frame of pulse 30 arrives twice.
  EXPECT_TRUE(matcher.label({at(31), 1, frame(30, 0).received}).suspect);
  EXPECT_TRUE(matcher.label({at(32), 2, frame(31, 0).received}).suspect);
  EXPECT_TRUE(matcher.label({at(31), 1, frame(31.2, 0).received}).suspect);
}

TEST(PulseMatcher, labels_a_late_frame_of_a_reopened_camera_by_its_clock_and_suspects_it) {
  for (const double late : {0.6, 1.4, 5.0}) {
    PulseMatcher matcher = running();
    matcher.reopened();
    const PulseMatch match = matcher.label(frame(30, 1, late));
    EXPECT_EQ(match.pulse, 30) << late;
    EXPECT_TRUE(match.suspect) << late;
    for (int k = 31; k < 40; ++k) EXPECT_EQ(matcher.label(frame(k, k - 29)).pulse, k) << late;
  }
}

TEST(PulseMatcher, labels_a_frame_by_its_arrival_after_a_restart_of_the_clock) {
  for (const double clock : {-400.0, 0.0, 12.0, 31.0, 1e6}) {
    PulseMatcher matcher = running();
    matcher.reopened();
    const PulseMatch match = matcher.label({at(clock), 1, frame(30, 0).received});
    EXPECT_EQ(match.pulse, 30) << clock;
    EXPECT_TRUE(match.suspect) << clock;
  }
}

TEST(PulseMatcher, labels_a_frame_by_its_counter_if_its_time_is_between_pulses) {
  PulseMatcher matcher = running();
  const PulseMatch late = matcher.label(frame(10.6, 110));
  EXPECT_EQ(late.pulse, 10);
  EXPECT_TRUE(late.suspect);
  const PulseMatch next = matcher.label(frame(11, 111));
  EXPECT_EQ(next.pulse, 11);
  EXPECT_FALSE(next.suspect);
}

TEST(PulseMatcher, suspects_a_duplicate_and_an_out_of_order_frame) {
  PulseMatcher matcher = running();
  const PulseMatch duplicate = matcher.label(frame(9, 109));
  EXPECT_EQ(duplicate.pulse, 9);
  EXPECT_TRUE(duplicate.suspect);
  const PulseMatch straggler = matcher.label(frame(5, 105));
  EXPECT_EQ(straggler.pulse, 5);
  EXPECT_TRUE(straggler.suspect);
  EXPECT_FALSE(matcher.label(frame(10, 110)).suspect);
}

TEST(PulseMatcher, suspects_the_first_frame_after_a_very_long_silence) {
  PulseMatcher matcher = running();
  EXPECT_TRUE(matcher.label(frame(100'000, 100'100)).suspect);
}

/// Labels of 20 frames from pulse 10 on, after a step of the clock by `stepped` periods and of the
/// counter by `moved`.
std::vector<PulseMatch> labels_after(double stepped, int64_t moved) {
  PulseMatcher matcher = running();
  std::vector<PulseMatch> found;
  for (int k = 10; k < 30; ++k) {
    FrameStamp stamp = frame(k, 100 + k + moved);
    stamp.exposed = at(k + stepped);
    found.push_back(matcher.label(stamp));
  }
  return found;
}

TEST(PulseMatcher, suspects_only_the_first_frame_after_a_step_of_the_clock) {
  for (const double stepped : {-1000.0, -3.0, -2.0, -0.5, 0.5, 1.0, 2.5, 7.0, 1e6}) {
    const std::vector<PulseMatch> found = labels_after(stepped, 0);
    for (int k = 0; k < 20; ++k) {
      EXPECT_EQ(found[k].suspect, k < 1) << stepped << ", frame " << k;
      EXPECT_EQ(found[k].pulse, 10 + k) << stepped;
    }
  }
}

TEST(PulseMatcher, suspects_eight_frames_after_a_step_that_looks_like_a_delay) {
  const std::vector<PulseMatch> found = labels_after(-1.0, 0);
  for (int k = 0; k < 20; ++k) EXPECT_EQ(found[k].suspect, k < 8) << k;
  EXPECT_EQ(found.back().pulse, 29);
}

/// The camera counts a repeated frame. While the host is busy, the counter and the arrival agree on
/// a wrong pulse.
TEST(PulseMatcher, labels_frames_that_are_late_after_a_repeated_frame_by_their_clock) {
  for (int late_frames = 1; late_frames <= 8; ++late_frames) {
    PulseMatcher matcher = running();
    EXPECT_TRUE(matcher.label(frame(9, 110)).suspect);
    for (int k = 10; k < 30; ++k) {
      const PulseMatch match = matcher.label(frame(k, 101 + k, k < 10 + late_frames ? 1 : 0));
      EXPECT_TRUE(match.suspect || match.pulse == k)
          << late_frames << " late frames, frame " << k << " was labelled " << match.pulse;
    }
  }
}

TEST(PulseMatcher, suspects_only_the_first_frame_after_a_jump_of_the_counter) {
  for (const int64_t moved : {-110, -1, 1, 5, 5000}) {
    const std::vector<PulseMatch> found = labels_after(0, moved);
    for (int k = 0; k < 20; ++k) {
      EXPECT_EQ(found[k].suspect, k < 1) << moved << ", frame " << k;
      EXPECT_EQ(found[k].pulse, 10 + k) << moved;
    }
  }
}

TEST(PulseMatcher, suspects_eight_frames_if_clock_and_counter_both_restart) {
  const std::vector<PulseMatch> found = labels_after(-500, -110);
  for (int k = 0; k < 20; ++k) EXPECT_EQ(found[k].suspect, k < 8) << k;
  EXPECT_EQ(found.back().pulse, 29);
}

TEST(PulseMatcher, does_not_suspect_frames_that_are_only_late) {
  PulseMatcher matcher = running();
  for (int k = 10; k < 40; ++k) {
    const PulseMatch match = matcher.label(frame(k, 100 + k, 39.5 - k));
    EXPECT_EQ(match.pulse, k);
    EXPECT_FALSE(match.suspect);
  }
}

TEST(PulseMatcher, suspects_frames_while_they_arrive_late) {
  PulseMatcher matcher = running();
  for (int k = 11; k < 30; ++k) {  // the camera missed the trigger of pulse 10
    EXPECT_TRUE(matcher.label(frame(k, 99 + k, 30.0 - k)).suspect);
  }
  for (int k = 30; k < 40; ++k) {
    const PulseMatch match = matcher.label(frame(k, 99 + k));
    EXPECT_EQ(match.suspect, k < 31);
    EXPECT_EQ(match.pulse, k);
  }
}

TEST(PulseMatcher, labels_a_hundred_thousand_pulses_without_drift) {
  for (const double ppm : {-200.0, 0.0, 200.0}) {
    std::mt19937 random(1);
    std::uniform_real_distribution<double> jitter(-0.1, 0.1);
    PulseMatcher matcher(kPeriod);
    for (int pulse = 0; pulse < 100'000; ++pulse) {
      FrameStamp stamp = frame(pulse, pulse);
      stamp.exposed = at(pulse + jitter(random), ppm);
      const PulseMatch match = matcher.label(stamp);
      ASSERT_EQ(match.pulse, pulse) << ppm;
      ASSERT_FALSE(match.suspect) << ppm;
    }
  }
}

RC_GTEST_PROP(PulseMatcher, follows_a_clock_that_warms_up, ()) {
  const double rise_ppm_per_s = *rc::gen::inRange(-100, 101) * 1e-3;
  std::mt19937 random(*rc::gen::arbitrary<unsigned>());
  std::uniform_real_distribution<double> unit(-1, 1);
  PulseMatcher matcher(kPeriod);
  double device_s = 0;
  double ppm = 0;
  for (int64_t pulse = 0; pulse < 20'000; ++pulse) {
    const double jitter_s = 0.05 * 0.04 * unit(random);
    const auto stamp = from_ns<DeviceClock>(std::llround((device_s + jitter_s) * 1e9));
    FrameStamp seen = frame(static_cast<double>(pulse), pulse);
    seen.exposed = stamp;
    const PulseMatch match = matcher.label(seen);
    RC_ASSERT(match.pulse == pulse);
    RC_ASSERT(!match.suspect);
    ppm += std::abs(ppm) < 200 ? rise_ppm_per_s * 0.04 : 0;
    device_s += 0.04 * (1 + ppm * 1e-6);
  }
}

/// A camera whose frames another process has labelled, before an interruption.
class ReturnedCamera {
 public:
  ReturnedCamera(unsigned seed, double ppm) : random_(seed), ppm_(ppm) {
    for (int64_t pulse = 0; pulse < kKnown; ++pulse) known_.push_back({stamp(pulse), pulse});
  }
  /// A matcher that resumes from the labelled frames.
  PulseMatcher matcher() const {
    PulseMatcher matcher(kPeriod);
    matcher.resume_from(known_);
    return matcher;
  }
  FrameStamp stamp(int64_t pulse) {
    FrameStamp seen = frame(static_cast<double>(pulse), static_cast<uint64_t>(pulse));
    seen.exposed = at(static_cast<double>(pulse) + 0.1 * unit_(random_), ppm_);
    seen.received += Duration(std::llround(0.1 * (1 + unit_(random_)) * 40e6));
    return seen;
  }
  static constexpr int64_t kKnown = 256;

 private:
  std::mt19937 random_;
  std::uniform_real_distribution<double> unit_{-1, 1};
  double ppm_;
  std::vector<KnownFrame> known_;
};

/// The expected arrivals are wrong by half a period or more, as with a wrong latency.
RC_GTEST_PROP(PulseMatcher, stays_suspect_while_a_running_clock_contradicts_the_expected_arrivals,
              ()) {
  ReturnedCamera camera(*rc::gen::arbitrary<unsigned>(), *rc::gen::inRange(-100, 101));
  PulseMatcher matcher = camera.matcher();
  const double error = *rc::gen::inRange(50, 2500) * 0.01 * *rc::gen::elementOf(std::vector{-1, 1});
  const int64_t back = ReturnedCamera::kKnown + *rc::gen::inRange(1, 1500);
  for (int64_t pulse = back; pulse < back + 12'000; ++pulse) {
    matcher.expect(pulse, frame(static_cast<double>(pulse), 0, error).received);
    const PulseMatch match = matcher.label(camera.stamp(pulse));
    const bool is_wrong = !match.suspect && match.pulse != pulse;
    RC_ASSERT_FALSE(is_wrong);
  }
}

/// The first frames are late by one period, and the clock's fit is so imprecise that it may agree.
RC_GTEST_PROP(PulseMatcher, needs_nine_frames_if_the_clock_is_imprecise_after_a_return, ()) {
  ReturnedCamera camera(*rc::gen::arbitrary<unsigned>(), *rc::gen::inRange(-100, 101));
  PulseMatcher matcher = camera.matcher();
  const int64_t back = ReturnedCamera::kKnown + *rc::gen::inRange(20'000, 100'000);
  for (int64_t pulse = back; pulse < back + 50; ++pulse) {
    matcher.expect(pulse, frame(static_cast<double>(pulse), 0, 0.05).received);
    FrameStamp seen = camera.stamp(pulse);
    if (pulse < back + 8) seen.received += kPeriod;
    const PulseMatch match = matcher.label(seen);
    const bool is_wrong = !match.suspect && match.pulse != pulse;
    RC_ASSERT_FALSE(is_wrong);
  }
}

RC_GTEST_PROP(PulseMatcher, is_certain_after_a_return_with_the_right_latency, ()) {
  ReturnedCamera camera(*rc::gen::arbitrary<unsigned>(), *rc::gen::inRange(-100, 101));
  PulseMatcher matcher = camera.matcher();
  const int64_t back = ReturnedCamera::kKnown + *rc::gen::inRange(1, 100'000);
  for (int64_t pulse = back; pulse < back + 100; ++pulse) {
    if (matcher.is_resuming()) {
      matcher.expect(pulse, frame(static_cast<double>(pulse), 0, 0.05).received);
    }
    const PulseMatch match = matcher.label(camera.stamp(pulse));
    const bool is_right = match.suspect ? pulse < back + 9 : match.pulse == pulse;
    RC_ASSERT(is_right);
  }
}

}  // namespace
}  // namespace v3d::capture
