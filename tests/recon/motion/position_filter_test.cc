#include "recon/motion/position_filter.h"

#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <random>
#include <vector>

namespace v3d::recon {
namespace {

using Eigen::Vector3f;
using Paths = std::vector<std::vector<Vector3f>>;

constexpr int kPulses = 21;

Paths one_vertex(const std::function<Vector3f(float)>& path) {
  Paths positions;
  for (int i = 0; i < kPulses; ++i) positions.push_back({path(static_cast<float>(i))});
  return positions;
}

float largest_difference(const Paths& a, const Paths& b) {
  float largest = 0;
  for (size_t i = 0; i < a.size(); ++i) largest = std::max(largest, (a[i][0] - b[i][0]).norm());
  return largest;
}

/// Root mean square of the steps from pulse to pulse, without the ends.
float steps(const Paths& positions) {
  float sum = 0;
  for (size_t i = 6; i < 15; ++i) sum += (positions[i][0] - positions[i - 1][0]).squaredNorm();
  return std::sqrt(sum / 9);
}

Paths with_noise(Paths positions, float deviation_m) {
  std::mt19937 random(5);
  std::normal_distribution<float> noise(0, deviation_m);
  for (auto& pulse : positions) pulse[0] += Vector3f(noise(random), noise(random), noise(random));
  return positions;
}

TEST(SmoothInTime, makes_the_steps_of_a_still_vertex_five_times_smaller) {
  const Paths still = with_noise(one_vertex([](float) { return Vector3f(1, 2, 0.5F); }), 0.0001F);
  Paths smoothed = still;
  smooth_in_time(smoothed);
  EXPECT_LT(steps(smoothed), steps(still) / 5);
}

TEST(SmoothInTime, keeps_a_path_of_steady_acceleration) {
  const Paths falling =
      one_vertex([](float t) { return Vector3f(0.03F * t, 1, 2 - 0.0078F * t * t); });
  Paths smoothed = falling;
  smooth_in_time(smoothed);
  EXPECT_LT(largest_difference(smoothed, falling), 1e-5F);
}

TEST(SmoothInTime, brings_a_noisy_moving_path_nearer_to_the_true_one) {
  const Paths truth = one_vertex([](float t) { return Vector3f(0.03F * t, 1, 0.001F * t * t); });
  const Paths noisy = with_noise(truth, 0.0005F);
  Paths smoothed = noisy;
  smooth_in_time(smoothed);
  float before = 0, after = 0;
  for (size_t i = 0; i < truth.size(); ++i) {
    before += (noisy[i][0] - truth[i][0]).squaredNorm();
    after += (smoothed[i][0] - truth[i][0]).squaredNorm();
  }
  EXPECT_LT(after, 0.7F * before);
}

TEST(SmoothInTime, keeps_the_pulse_of_a_sudden_stop) {
  const Paths stops =
      one_vertex([](float t) { return Vector3f(0.04F * std::min(t, 10.0F), 0, 1); });
  Paths smoothed = stops;
  smooth_in_time(smoothed);
  EXPECT_LT(largest_difference(smoothed, stops), 0.001F);
}

TEST(SmoothInTime, leaves_the_first_and_the_last_pulse_as_they_are) {
  const Paths noisy = with_noise(one_vertex([](float) { return Vector3f(0, 0, 1); }), 0.0001F);
  Paths smoothed = noisy;
  smooth_in_time(smoothed);
  EXPECT_EQ(smoothed.front(), noisy.front());
  EXPECT_EQ(smoothed.back(), noisy.back());
  EXPECT_NE(smoothed[10], noisy[10]);
}

TEST(SmoothInTime, accepts_a_segment_of_one_pulse_and_one_without_pulses) {
  Paths one{{Vector3f(1, 2, 3)}}, none;
  smooth_in_time(one);
  smooth_in_time(none);
  EXPECT_EQ(one[0][0], Vector3f(1, 2, 3));
  EXPECT_TRUE(none.empty());
}

}  // namespace
}  // namespace v3d::recon
