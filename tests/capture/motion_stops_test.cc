#include "capture/segmentation/motion_stops.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <random>

namespace v3d::segmentation {
namespace {

using testing::DoubleNear;
using testing::IsEmpty;
using testing::SizeIs;

constexpr double kRate = 25;
constexpr ImageSize kSize{128, 96};

TEST(StopsOfMotion, lie_at_the_fraction_given_by_the_last_change) {
  const auto part = stops_of_motion(std::vector<double>{0, 0, 0, 4, 4, 4, 1, 0, 0}, kRate);
  ASSERT_THAT(part, SizeIs(1));
  EXPECT_THAT(part[0].pulse, DoubleNear(5.25, 1e-9));
  EXPECT_THAT(part[0].change, DoubleNear(4, 1e-9));
  const auto whole = stops_of_motion(std::vector<double>{0, 0, 0, 4, 4, 4, 0, 0, 0}, kRate);
  ASSERT_THAT(whole, SizeIs(1));
  EXPECT_THAT(whole[0].pulse, DoubleNear(5, 1e-9));
}

TEST(StopsOfMotion, do_not_exist_in_stillness_and_in_steady_motion) {
  EXPECT_THAT(stops_of_motion(std::vector<double>{0, 0.1, 0.1, 0.2, 0.1, 0.1}, kRate), IsEmpty());
  EXPECT_THAT(stops_of_motion(std::vector<double>{0, 4, 4, 4, 3.9, 4, 4}, kRate), IsEmpty());
  EXPECT_THAT(stops_of_motion({}, kRate), IsEmpty());
}

/// A hand of 20 x 20 pixels that comes down by 3 pixels a pulse and stops at `stop`, before a wall
/// of noise with a deviation of 3 grey values.
Image hand_at(double pulse, double stop, std::mt19937& random) {
  std::normal_distribution<double> noise(0, 3);
  Image image(kSize, PixelFormat::kMono8);
  const double top = 70 - 3 * std::max(0.0, stop - std::max(pulse, stop - 15));
  for (int y = 0; y < kSize.height; ++y) {
    for (int x = 0; x < kSize.width; ++x) {
      const double inside = std::clamp(10.5 - std::abs(y + 0.5 - top), 0.0, 1.0);
      const double grey = 80 + (x >= 50 && x < 70 ? 100 * inside : 0) + noise(random);
      image.row(y)[x] = static_cast<uint8_t>(std::lround(grey));
    }
  }
  return image;
}

TEST(MotionSeries, finds_a_hand_that_stops_in_pictures_with_noise) {
  std::mt19937 random(1);
  MotionSeries series;
  for (int64_t pulse = 100; pulse < 160; ++pulse) {
    series.add(pulse, hand_at(static_cast<double>(pulse), 130.4, random).view());
  }
  const auto stop = stop_near(series.stops(kRate), 128, kRate);
  ASSERT_TRUE(stop);
  EXPECT_THAT(stop->pulse, DoubleNear(130.4, 0.5));
  EXPECT_FALSE(stop_near(series.stops(kRate), 150, kRate)) << "more than half a second away";
}

TEST(MotionSeries, finds_no_stop_in_a_gap) {
  std::mt19937 random(1);
  MotionSeries series;
  for (int64_t pulse = 100; pulse < 160; ++pulse) {
    if (pulse == 131) continue;
    series.add(pulse, hand_at(static_cast<double>(pulse), 130.4, random).view());
  }
  EXPECT_THAT(series.stops(kRate), IsEmpty());
}

TEST(MotionSeries, keeps_the_greatest_stops_in_their_order) {
  MotionSeries series;
  const auto count = static_cast<int64_t>(MotionSeries::kMaxStops) + 8;
  Image image(kSize, PixelFormat::kMono8);
  for (int64_t pulse = 0; pulse < 30 * count; ++pulse) {
    // Every 30 pulses the picture changes for 8 pulses; the first 8 times it changes less.
    const int step = pulse < 30 * 8 ? 20 : 30;
    if (pulse % 30 < 8) {
      for (uint8_t& byte : image.bytes) byte = static_cast<uint8_t>(step * (pulse % 30 % 2));
    }
    series.add(pulse, image.view());
  }
  const auto stops = series.stops(kRate);
  ASSERT_THAT(stops, SizeIs(MotionSeries::kMaxStops));
  EXPECT_THAT(stops.front().pulse, DoubleNear(30 * 8 + 7, 1));
  EXPECT_THAT(stops.back().pulse, DoubleNear(30 * (static_cast<double>(count) - 1) + 7, 1));
}

TEST(MotionSeries, ignores_a_second_picture_of_a_pulse) {
  MotionSeries series;
  Image black(kSize, PixelFormat::kMono8), white(kSize, PixelFormat::kMono8);
  std::ranges::fill(white.bytes, 255);
  for (int64_t pulse = 0; pulse < 20; ++pulse) series.add(pulse, black.view());
  series.add(19, white.view());
  for (int64_t pulse = 20; pulse < 40; ++pulse) series.add(pulse, black.view());
  EXPECT_THAT(series.stops(kRate), IsEmpty());
}

}  // namespace
}  // namespace v3d::segmentation
