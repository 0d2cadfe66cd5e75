#include "sound/clock_filter.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <random>

namespace v3d::sound {
namespace {

using testing::DoubleNear;
using testing::Lt;

/// Adds a minute of pairs, ten in a second, of a clock that is 80 ppm fast and `ahead` of x.
void add_minute(ClockFilter& filter, double from, double ahead, double noise, unsigned seed) {
  std::mt19937 random(seed);
  std::normal_distribution<double> error(0, noise);
  for (int i = 0; i < 600; ++i) {
    const double x = from + 0.1 * i;
    filter.add(x, x * (1 + 80e-6) + ahead + error(random));
  }
}

TEST(ClockFilter, finds_offset_and_drift_below_the_noise_of_the_pairs) {
  ClockFilter filter({});
  add_minute(filter, 0, 5, 1e-3, 1);
  EXPECT_THAT(filter.at(60), DoubleNear(60 * (1 + 80e-6) + 5, 0.3e-3));
  EXPECT_THAT(filter.drift(), DoubleNear(80e-6, 10e-6));
}

TEST(ClockFilter, states_a_deviation_that_its_errors_keep) {
  double sum = 0;
  constexpr int kRuns = 200;
  for (unsigned seed = 0; seed < kRuns; ++seed) {
    ClockFilter filter({});
    add_minute(filter, 0, 5, 1e-3, seed);
    sum += std::pow((filter.at(60) - 60 * (1 + 80e-6) - 5) / filter.deviation_at(60), 2);
  }
  EXPECT_THAT(sum / kRuns, DoubleNear(1, 0.4));
}

TEST(ClockFilter, ignores_pairs_far_outside_of_the_noise) {
  ClockFilter filter({});
  add_minute(filter, 0, 5, 1e-4, 1);
  const double before = filter.at(60.05);
  EXPECT_FALSE(filter.add(60.05, before + 0.02));
  EXPECT_DOUBLE_EQ(filter.at(60.05), before);
}

TEST(ClockFilter, follows_a_clock_that_has_jumped) {
  ClockFilter filter({});
  add_minute(filter, 0, 5, 1e-4, 1);
  add_minute(filter, 60, 5.5, 1e-4, 2);
  EXPECT_THAT(filter.at(120), DoubleNear(120 * (1 + 80e-6) + 5.5, 1e-4));
}

TEST(ClockFilter, keeps_its_drift_over_a_jump_that_was_reported) {
  ClockFilter filter({});
  add_minute(filter, 0, 5, 1e-5, 1);
  const double drift = filter.drift();
  filter.jump(0.1);
  EXPECT_TRUE(filter.add(60, 60 * (1 + 80e-6) + 5.1));
  EXPECT_THAT(filter.drift(), DoubleNear(drift, 1e-6));
  EXPECT_THAT(filter.at(60), DoubleNear(60 * (1 + 80e-6) + 5.1, 1e-4));
}

TEST(ClockFilter, estimates_the_noise_of_the_pairs) {
  ClockFilter filter({});
  add_minute(filter, 0, 5, 1e-4, 1);
  EXPECT_THAT(filter.pair_deviation(), DoubleNear(1e-4, 0.3e-4));
}

}  // namespace
}  // namespace v3d::sound
