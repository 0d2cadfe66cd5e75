// A simulated hour of recording, in virtual time.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

#include "virtual_sound.h"

namespace v3d::sound {
namespace {

using test::VirtualSound;
using test::VirtualSoundFaults;
using testing::DoubleNear;
using testing::Gt;
using testing::Le;

constexpr double kHour = 3600;
constexpr PulseMapper::Setup kWithChannel{.has_pulse_channel = true};

double median_of(const std::vector<double>& errors) { return errors[errors.size() / 2]; }

TEST(SimulatedHour, maps_every_pulse_within_1_ms_and_half_of_them_within_a_tenth) {
  const VirtualSound hour(kWithChannel, kHour, {}, 1);
  const MappedPulses mapped = hour.mapper().result();
  ASSERT_EQ(mapped.source, MapSource::kPulseChannel);
  EXPECT_THAT(hour.xruns(), Gt(10U));
  const auto errors = hour.errors(mapped.map);
  RecordProperty("median_us", std::to_string(1e6 * median_of(errors)));
  RecordProperty("max_us", std::to_string(1e6 * errors.back()));
  EXPECT_THAT(median_of(errors), Le(0.1e-3));
  EXPECT_THAT(errors.back(), Le(1e-3));
}

TEST(SimulatedHour, measures_the_drift_of_the_sound_clock_against_the_pulses) {
  const VirtualSound hour(kWithChannel, kHour, {}, 2);
  // The sound is fast by 80 ppm and the pulses slow by 15.
  EXPECT_THAT(hour.mapper().result().drift_ppm, DoubleNear(95, 1));
}

TEST(SimulatedHour, counts_lost_and_additional_edges) {
  const VirtualSoundFaults faults{
      .lost_edges = 0, .extra_edges = 0, .lost_bursts = 1, .xruns_per_s = 0};
  const VirtualSound clean(kWithChannel, 600, faults, 3);
  const MappedPulses mapped = clean.mapper().result();
  EXPECT_EQ(mapped.missing_edges, 100);
  EXPECT_EQ(mapped.extra_edges, 0);
  EXPECT_EQ(mapped.edges + mapped.missing_edges, std::ssize(clean.truth()));
}

TEST(SimulatedHour, maps_pulses_by_time_stamps_within_the_stated_uncertainty) {
  VirtualSoundFaults faults;
  faults.xruns_per_s = 0;
  const VirtualSound hour({}, kHour, faults, 4);
  const MappedPulses mapped = hour.mapper().result();
  ASSERT_EQ(mapped.source, MapSource::kTimeStamps);
  const auto errors = hour.errors(mapped.map);
  EXPECT_THAT(errors[errors.size() * 68 / 100], Le(mapped.uncertainty_s));
  EXPECT_THAT(errors.back(), Le(3 * mapped.uncertainty_s));
  EXPECT_THAT(mapped.drift_ppm, DoubleNear(80, 3));
}

TEST(SimulatedHour, falls_back_to_time_stamps_when_the_pulse_channel_is_silent) {
  const VirtualSoundFaults silent{.lost_edges = 1, .extra_edges = 0};
  const VirtualSound hour(kWithChannel, 60, silent, 5);
  const MappedPulses mapped = hour.mapper().result();
  EXPECT_EQ(mapped.source, MapSource::kTimeStamps);
  EXPECT_EQ(mapped.missing_edges, std::ssize(hour.truth()));
}

TEST(SimulatedHour, is_mapped_by_few_knots) {
  const VirtualSound hour(kWithChannel, kHour, {}, 6);
  EXPECT_THAT(hour.mapper().result().map.knots.size(), Le(5000U));
}

TEST(SimulatedHour, follows_120_pulses_per_second) {
  PulseMapper::Setup fast = kWithChannel;
  fast.pulse_rate_hz = 120;
  const VirtualSound minutes(fast, 600, {}, 7);
  const auto errors = minutes.errors(minutes.mapper().result().map);
  EXPECT_THAT(median_of(errors), Le(0.1e-3));
  EXPECT_THAT(errors.back(), Le(1e-3));
}

/// Two minutes with an xrun every 40 s and a run of lost edges.
VirtualSound minutes_with_frequent_xruns(VirtualSoundFaults faults, unsigned seed) {
  faults.xruns_per_s = 1.0 / 40;
  faults.lost_bursts = 1;
  return {kWithChannel, 120, faults, seed};
}

TEST(SimulatedHour, returns_to_the_right_pulses_where_silence_of_wrong_length_led_to_others) {
  const auto minutes = minutes_with_frequent_xruns(
      {.sound_ppm = -150, .pulses_ppm = -50, .lost_edges = 0, .fill_error_s = 6e-3}, 860226);
  EXPECT_THAT(median_of(minutes.errors(minutes.mapper().result().map)), Le(0.1e-3));
}

// A part between two xruns may have no edge at all, or belong to other pulses until the clocks show
// it: a period bounds the error there.
RC_GTEST_PROP(VirtualSoundProperty, every_pulse_is_mapped_within_a_period_under_frequent_faults,
              ()) {
  VirtualSoundFaults faults;
  faults.sound_ppm = *rc::gen::inRange(-150, 151);
  faults.pulses_ppm = *rc::gen::inRange(-50, 51);
  faults.fill_error_s = *rc::gen::inRange(0, 10) * 1e-3;
  faults.lost_edges = *rc::gen::inRange(0, 20) * 1e-2;
  const auto minutes = minutes_with_frequent_xruns(faults, *rc::gen::inRange(0U, 1'000'000U));
  const auto errors = minutes.errors(minutes.mapper().result().map);
  RC_ASSERT(median_of(errors) <= 0.1e-3);
  RC_ASSERT(errors.back() <= 1.01 / kWithChannel.pulse_rate_hz);
}

}  // namespace
}  // namespace v3d::sound
