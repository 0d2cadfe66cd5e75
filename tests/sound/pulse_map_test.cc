#include "sound/pulse_map.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

#include <algorithm>
#include <cmath>
#include <random>

namespace v3d::sound {
namespace {

using testing::DoubleNear;
using testing::ElementsAre;
using testing::Le;
using testing::SizeIs;

using Knot = PulseMap::Knot;

bool ascends(const PulseMap& map) {
  const auto is_not_above = [](const Knot& a, const Knot& b) {
    return b.pulse <= a.pulse || b.sample <= a.sample;
  };
  return std::ranges::adjacent_find(map.knots, is_not_above) == map.knots.end();
}

double largest_error(const PulseMap& map, const std::vector<Knot>& points) {
  double error = 0;
  for (const Knot& point : points) {
    error = std::max(error, std::abs(map.sample_of(point.pulse) - point.sample));
  }
  return error;
}

TEST(PulseMap, is_linear_between_knots_and_beyond_them) {
  const PulseMap map{{{0, 100}, {10, 200}, {20, 400}}};
  EXPECT_DOUBLE_EQ(map.sample_of(5), 150);
  EXPECT_DOUBLE_EQ(map.sample_of(15), 300);
  EXPECT_DOUBLE_EQ(map.sample_of(-1), 90);
  EXPECT_DOUBLE_EQ(map.sample_of(21), 420);
  EXPECT_DOUBLE_EQ(map.pulse_of(300), 15);
}

TEST(PulseMapBuilder, needs_two_knots_for_a_steady_clock) {
  PulseMapBuilder builder(1);
  for (int n = 0; n < 100'000; ++n) builder.add({n * 1.0, 777 + n * 1920.15});
  EXPECT_THAT(builder.map().knots, SizeIs(2));
  EXPECT_THAT(builder.slope(), DoubleNear(1920.15, 1e-3));
}

TEST(PulseMapBuilder, extends_the_lines_on_both_sides_of_a_gap) {
  PulseMapBuilder builder(0.5);
  for (int n = 0; n <= 10; ++n) builder.add({n * 1.0, n * 100.0});
  // 250 samples of silence stand for 5 pulses.
  builder.add_gap(1050, 1300, 100);
  for (int n = 16; n <= 30; ++n) builder.add({n * 1.0, n * 100.0 - 250});
  const PulseMap map = builder.map();
  EXPECT_THAT(map.sample_of(10.25), DoubleNear(1025, 1));
  EXPECT_THAT(map.sample_of(15.75), DoubleNear(1325, 1));
  EXPECT_THAT(map.sample_of(13), DoubleNear(1175, 1));
  EXPECT_THAT(builder.slope(), DoubleNear(100, 0.1));
}

TEST(PulseMapBuilder, ignores_points_within_a_gap_and_points_that_descend) {
  PulseMapBuilder builder(0.5);
  for (int n = 0; n <= 10; ++n) builder.add({n * 1.0, n * 100.0});
  builder.add({9, 1100});
  builder.add({11, 900});
  builder.add_gap(1050, 1300, 100);
  builder.add({12, 1200});
  EXPECT_EQ(builder.points(), 11);
}

TEST(PulseMapBuilder, is_bounded_when_no_line_fits) {
  PulseMapBuilder builder(1);
  for (int n = 0; n < 100'000; ++n) builder.add({n * 1.0, n * 1920.0 + (n % 2) * 300.0});
  EXPECT_THAT(builder.map().knots.size(), Le(PulseMapBuilder::kMaxKnots + 1));
  for (const int n : {0, 1, 50'001, 99'999}) {
    EXPECT_THAT(builder.map().sample_of(n), DoubleNear(n * 1920 + 150, 300 + builder.tolerance()));
  }
}

TEST(PulseMapBuilder, ascends_after_an_hour_of_pulses_with_jitter) {
  constexpr double kJitter = 60e-6;  // s
  for (unsigned seed = 0; seed < 20; ++seed) {
    SCOPED_TRACE(seed);
    std::mt19937 random(seed);
    std::normal_distribution<double> jitter(0, kJitter);
    PulseMapBuilder builder(2.4);
    std::vector<Knot> points;
    for (int n = 0; n < 216'000; ++n) {
      points.push_back({n * 1.0, 144'000 + 48'000 * (n / 60.0 + jitter(random))});
      builder.add(points.back());
    }
    const PulseMap map = builder.map();
    EXPECT_TRUE(ascends(map));
    EXPECT_GT(builder.tolerance(), 2.4) << "it was thinned out";
    EXPECT_THAT(largest_error(map, points), Le(builder.tolerance() + 1e-6));
  }
}

RC_GTEST_PROP(PulseMapBuilderProperty, every_point_is_within_the_tolerance_and_knots_ascend, ()) {
  PulseMapBuilder builder(1.2);
  std::vector<Knot> points;
  double pulse = 0, sample = 0;
  const int count = *rc::gen::inRange(2, 200);
  for (int i = 0; i < count; ++i) {
    pulse += *rc::gen::inRange(1, 4);
    sample += *rc::gen::inRange(400, 2000);
    points.push_back({pulse, sample});
    builder.add(points.back());
  }
  const PulseMap map = builder.map();
  for (const Knot& point : points) {
    RC_ASSERT(std::abs(map.sample_of(point.pulse) - point.sample) <= 1.2 + 1e-6);
    RC_ASSERT(std::abs(map.sample_of(map.pulse_of(point.sample)) - point.sample) <= 1e-6);
  }
  RC_ASSERT(ascends(map));
}

RC_GTEST_PROP(PulseMapBuilderProperty, a_map_with_gaps_that_was_thinned_out_is_exact_and_ascends,
              ()) {
  const auto max_knots = static_cast<size_t>(*rc::gen::inRange(4, 30));
  PulseMapBuilder builder(1.2, max_knots);
  std::vector<Knot> added;
  double pulse = 0, sample = 0;
  const int count = *rc::gen::inRange(2, 300);
  const int least_step = *rc::gen::element(1, 100, 1900);
  for (int i = 0; i < count; ++i) {
    pulse += *rc::gen::inRange(1, 4);
    sample += *rc::gen::inRange(least_step, 2000);
    if (*rc::gen::inRange(0, 10) == 0) {
      const double length = *rc::gen::inRange(0, 5000);
      builder.add_gap(sample, sample + length, *rc::gen::inRange(400, 2000));
      sample += length - *rc::gen::inRange(0, 1000);
    }
    const int64_t before = builder.points();
    builder.add({pulse, sample});
    if (builder.points() > before) added.push_back({pulse, sample});
  }
  const PulseMap map = builder.map();
  RC_PRE(map.is_known());
  RC_ASSERT(map.knots.size() <= max_knots + 1);
  RC_ASSERT(ascends(map));
  RC_ASSERT(largest_error(map, added) <= builder.tolerance() + 1e-6);
}

}  // namespace
}  // namespace v3d::sound
