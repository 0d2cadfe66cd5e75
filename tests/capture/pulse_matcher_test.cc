#include "capture/pulse_matcher.h"

#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

#include <cmath>
#include <random>
#include <vector>

namespace v3d {
namespace {

constexpr Duration kPeriod = std::chrono::milliseconds(40);

DeviceInstant at(double pulses, double ppm = 0) {
  return from_ns<DeviceClock>(1'000'000'000 + std::llround(pulses * 40e6 * (1 + ppm * 1e-6)));
}

PulseMatcher running() {
  PulseMatcher matcher(kPeriod);
  for (int k = 0; k < 10; ++k) matcher.label(at(k), 100 + k);
  return matcher;
}

TEST(PulseMatcher, calls_the_first_frame_pulse_0) {
  PulseMatcher matcher(kPeriod);
  const PulseMatch match = matcher.label(at(1234.5), 77);
  EXPECT_EQ(match.pulse, 0);
  EXPECT_FALSE(match.suspect);
}

TEST(PulseMatcher, leaves_out_the_pulse_whose_frame_was_lost_in_transport) {
  PulseMatcher matcher = running();
  const PulseMatch match = matcher.label(at(12), 112);
  EXPECT_EQ(match.pulse, 12);
  EXPECT_FALSE(match.suspect);
}

TEST(PulseMatcher, leaves_out_the_first_pulses_when_the_counter_shows_that_they_were_lost) {
  PulseMatcher matcher(kPeriod);
  matcher.expect(42);
  const PulseMatch first = matcher.label(at(2), 44);
  EXPECT_EQ(first.pulse, 2);
  EXPECT_TRUE(first.suspect);
  const PulseMatch next = matcher.label(at(3), 45);
  EXPECT_EQ(next.pulse, 3);
  EXPECT_FALSE(next.suspect);
}

TEST(PulseMatcher, trusts_a_first_frame_with_the_expected_counter) {
  PulseMatcher matcher(kPeriod);
  matcher.expect(42);
  const PulseMatch match = matcher.label(at(0), 42);
  EXPECT_EQ(match.pulse, 0);
  EXPECT_FALSE(match.suspect);
}

TEST(PulseMatcher, suspects_a_first_frame_whose_counter_makes_no_sense) {
  for (const uint64_t counter : {41U, 0U, 2000U}) {
    PulseMatcher matcher(kPeriod);
    matcher.expect(42);
    const PulseMatch match = matcher.label(at(0), counter);
    EXPECT_EQ(match.pulse, 0);
    EXPECT_TRUE(match.suspect) << counter;
  }
}

TEST(PulseMatcher, suspects_the_frame_after_a_trigger_that_the_camera_missed) {
  PulseMatcher matcher = running();
  const PulseMatch match = matcher.label(at(11), 110);
  EXPECT_EQ(match.pulse, 11);
  EXPECT_TRUE(match.suspect);
  EXPECT_FALSE(matcher.label(at(12), 111).suspect);
}

TEST(PulseMatcher, suspects_an_exposure_between_two_pulses) {
  PulseMatcher matcher = running();
  EXPECT_TRUE(matcher.label(at(10.4), 110).suspect);
  EXPECT_TRUE(matcher.label(at(11), 112).pulse == 11);
}

TEST(PulseMatcher, lets_the_counter_decide_where_the_time_is_in_doubt) {
  PulseMatcher matcher = running();
  const PulseMatch late = matcher.label(at(10.6), 110);
  EXPECT_EQ(late.pulse, 10);
  EXPECT_TRUE(late.suspect);
  const PulseMatch next = matcher.label(at(11), 111);
  EXPECT_EQ(next.pulse, 11);
  EXPECT_FALSE(next.suspect);
}

TEST(PulseMatcher, suspects_a_duplicate_and_a_straggler) {
  PulseMatcher matcher = running();
  const PulseMatch duplicate = matcher.label(at(9), 109);
  EXPECT_EQ(duplicate.pulse, 9);
  EXPECT_TRUE(duplicate.suspect);
  const PulseMatch straggler = matcher.label(at(5), 105);
  EXPECT_EQ(straggler.pulse, 5);
  EXPECT_TRUE(straggler.suspect);
  EXPECT_FALSE(matcher.label(at(10), 110).suspect);
}

TEST(PulseMatcher, suspects_the_first_frame_after_a_very_long_silence) {
  PulseMatcher matcher = running();
  EXPECT_TRUE(matcher.label(at(100'000), 100'100).suspect);
}

TEST(PulseMatcher, goes_on_from_the_pulse_it_is_restarted_at) {
  PulseMatcher matcher = running();
  matcher.restart(50, from_ns<DeviceClock>(5), 1);
  const PulseMatch match = matcher.label(from_ns<DeviceClock>(80'000'005), 3);
  EXPECT_EQ(match.pulse, 52);
  EXPECT_FALSE(match.suspect);
}

/// What happens to a camera within the stated limits.
struct Troubles {
  double ppm = 0;              ///< the device clock against the generator
  double jitter = 0;           ///< of a time stamp, +- periods
  double lost = 0;             ///< chance that a frame is lost in transport
  double missed = 0;           ///< chance that the camera misses a trigger
  double duplicate = 0;        ///< chance that a frame comes twice
  int longest_outage = 0;      ///< frames lost in a row, now and then
  uint64_t first_counter = 0;  ///< near the end of 64 bits, too
};

struct Score {
  int64_t wrong = 0;         ///< mislabelled without suspicion: must not happen
  int64_t wrong_at_all = 0;  ///< mislabelled, suspect or not
  int64_t suspect = 0;
  int64_t reasons = 0;  ///< frames that deserve suspicion
};

Score play(const Troubles& t, int pulses, unsigned seed) {
  std::mt19937 random(seed);
  std::uniform_real_distribution<double> unit(0, 1);
  PulseMatcher matcher(kPeriod);
  Score score;
  uint64_t counter = t.first_counter;
  int outage = 0;
  bool missed_before = false;
  for (int pulse = 0; pulse < pulses; ++pulse) {
    if (pulse > 0 && unit(random) < t.missed) {
      missed_before = true;
      continue;
    }
    const uint64_t this_counter = counter++;
    if (pulse > 0 && t.longest_outage > 0 && unit(random) < 1e-4) {
      outage = static_cast<int>(unit(random) * t.longest_outage);
    }
    const bool gone = pulse > 0 && (outage-- > 0 || unit(random) < t.lost);
    if (gone) continue;
    const DeviceInstant stamp = at(pulse + t.jitter * (2 * unit(random) - 1), t.ppm);
    const int copies = unit(random) < t.duplicate ? 2 : 1;
    for (int copy = 0; copy < copies; ++copy) {
      const PulseMatch match = matcher.label(stamp, this_counter);
      score.wrong += match.pulse != pulse && !match.suspect;
      score.wrong_at_all += match.pulse != pulse;
      score.suspect += match.suspect;
      score.reasons += copy > 0 || missed_before;
      missed_before = false;
    }
  }
  return score;
}

TEST(PulseMatcher, does_not_drift_off_in_a_hundred_thousand_pulses) {
  for (const double ppm : {-200.0, 0.0, 200.0}) {
    Troubles troubles;
    troubles.ppm = ppm;
    troubles.jitter = 0.1;
    const Score score = play(troubles, 100'000, 1);
    EXPECT_EQ(score.wrong_at_all, 0) << ppm;
    EXPECT_EQ(score.suspect, 0) << ppm;
  }
}

RC_GTEST_PROP(PulseMatcher, never_mislabels_without_suspicion_within_its_limits, ()) {
  Troubles t;
  t.ppm = *rc::gen::inRange(-200, 201);
  t.jitter = *rc::gen::inRange(0, 101) * 1e-3;
  t.lost = *rc::gen::inRange(0, 400) * 1e-3;
  t.missed = *rc::gen::inRange(0, 100) * 1e-3;
  t.duplicate = *rc::gen::inRange(0, 100) * 1e-3;
  t.longest_outage = *rc::gen::inRange(0, 200);
  t.first_counter = *rc::gen::element<uint64_t>(0, 1, 65'530, uint64_t(0) - 100);
  const Score score = play(t, 5'000, *rc::gen::arbitrary<unsigned>());
  RC_ASSERT(score.wrong_at_all == 0);
  RC_ASSERT(score.suspect == score.reasons);
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
    const PulseMatch match = matcher.label(stamp, pulse);
    RC_ASSERT(match.pulse == pulse);
    RC_ASSERT(!match.suspect);
    ppm += std::abs(ppm) < 200 ? rise_ppm_per_s * 0.04 : 0;
    device_s += 0.04 * (1 + ppm * 1e-6);
  }
}

}  // namespace
}  // namespace v3d
