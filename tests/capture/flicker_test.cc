#include <gtest/gtest.h>

#include <cmath>
#include <numbers>
#include <random>
#include <vector>

#include "capture/segmentation/image_measures.h"

namespace v3d::segmentation {
namespace {

/// Brightness of exposures of 1 ms under a lamp that flickers by `modulation`, with noise.
std::vector<PulseBrightness> lit_by(double lamp_hz, double modulation, double rate_hz, int pulses,
                                    double noise_grey = 0.05) {
  std::mt19937 random(7);
  std::normal_distribution<double> noise(0, noise_grey);
  constexpr double kExposure = 1e-3;
  std::vector<PulseBrightness> series;
  for (int pulse = 0; pulse < pulses; ++pulse) {
    const double w = 2 * std::numbers::pi * lamp_hz;
    const double begin = pulse / rate_hz + 0.0003;
    const double light = 1 + modulation *
                                 (std::cos(w * begin) - std::cos(w * (begin + kExposure))) /
                                 (w * kExposure);
    series.push_back({pulse, 80 * light + noise(random)});
  }
  return series;
}

/// What an exposure of 1 ms leaves of the modulation.
double averaged(double modulation, double lamp_hz) {
  const double x = std::numbers::pi * lamp_hz * 1e-3;
  return modulation * std::sin(x) / x;
}

TEST(Flicker, has_the_amplitude_and_the_beat_of_lamps_at_120_hz) {
  const auto found = measure_flicker(lit_by(120, 0.08, 25, 50), 25);
  ASSERT_TRUE(found);
  EXPECT_NEAR(found->beat_hz, 5, 0.05);
  EXPECT_NEAR(found->amplitude, averaged(0.08, 120), 0.003);
}

TEST(Flicker, finds_a_slow_beat_of_mains_that_is_not_exactly_50_hz) {
  const auto found = measure_flicker(lit_by(100.4, 0.05, 25, 100), 25);
  ASSERT_TRUE(found);
  EXPECT_NEAR(found->beat_hz, 0.4, 0.05);
  EXPECT_NEAR(found->amplitude, averaged(0.05, 100.4), 0.003);
}

TEST(Flicker, finds_a_beat_at_half_of_the_pulse_rate) {
  const auto found = measure_flicker(lit_by(100, 0.05, 40, 40), 40);
  ASSERT_TRUE(found);
  EXPECT_NEAR(found->beat_hz, 20, 0.2);
}

TEST(Flicker, tolerates_missing_pulses) {
  auto series = lit_by(120, 0.08, 25, 60);
  for (const int lost : {40, 23, 22, 21, 3}) series.erase(series.begin() + lost);
  const auto found = measure_flicker(series, 25);
  ASSERT_TRUE(found);
  EXPECT_NEAR(found->beat_hz, 5, 0.05);
  EXPECT_NEAR(found->amplitude, averaged(0.08, 120), 0.003);
}

TEST(Flicker, of_a_long_series_is_that_of_its_last_512_pictures) {
  const auto series = lit_by(100.4, 0.05, 25, 2000);
  const auto found = measure_flicker(series, 25);
  const auto expected = measure_flicker(std::span(series).last(kMaxFlickerPictures), 25);
  ASSERT_TRUE(found && expected);
  EXPECT_EQ(found->beat_hz, expected->beat_hz);
  EXPECT_EQ(found->amplitude, expected->amplitude);
  EXPECT_NEAR(found->beat_hz, 0.4, 0.01);
}

TEST(Flicker, is_absent_under_steady_light) {
  int alarms = 0;
  for (int seed = 0; seed < 200; ++seed) {
    std::mt19937 random(seed);
    std::normal_distribution<double> noise(80, 0.3);
    std::vector<PulseBrightness> series;
    for (int pulse = 0; pulse < 25; ++pulse) series.push_back({pulse, noise(random)});
    alarms += measure_flicker(series, 25).has_value();
  }
  EXPECT_LE(alarms, 2) << "expected about one in 1000 series";
}

TEST(Flicker, is_absent_if_every_exposure_meets_the_lamp_at_the_same_phase) {
  EXPECT_FALSE(measure_flicker(lit_by(100, 0.3, 25, 50), 25));
}

TEST(Flicker, is_not_measured_on_few_or_dark_pictures) {
  EXPECT_FALSE(measure_flicker(lit_by(120, 0.2, 25, 7), 25));
  auto dark = lit_by(120, 0.2, 25, 50);
  for (PulseBrightness& picture : dark) picture.grey /= 100;
  EXPECT_FALSE(measure_flicker(dark, 25));
  EXPECT_FALSE(measure_flicker({}, 25));
}

TEST(RateWithoutFlicker, is_the_nearest_whole_fraction_of_the_lamps_frequency) {
  EXPECT_EQ(rate_without_flicker(5, 25, 0.2), 24) << "120 Hz";
  EXPECT_NEAR(rate_without_flicker(10, 30, 0.2).value(), 100.0 / 3, 1e-9) << "100 Hz";
  EXPECT_EQ(rate_without_flicker(0.4, 25, 0.5), 25) << "100 Hz, up to the drift of the mains";
  EXPECT_EQ(rate_without_flicker(20, 60, 0.2), 50) << "100 Hz";
  EXPECT_FALSE(rate_without_flicker(7, 25, 0.2)) << "lamps with a frequency of their own";
}

}  // namespace
}  // namespace v3d::segmentation
