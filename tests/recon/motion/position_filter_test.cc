#include "recon/motion/position_filter.h"

#include <gtest/gtest.h>

#include <cmath>
#include <cstdint>
#include <functional>
#include <numeric>
#include <random>
#include <vector>

namespace v3d::recon {
namespace {

using Eigen::Vector3f;
using Paths = std::vector<std::vector<Vector3f>>;

constexpr size_t kPulses = 21;

std::vector<int64_t> successive(size_t count) {
  std::vector<int64_t> pulses(count);
  std::iota(pulses.begin(), pulses.end(), int64_t{0});
  return pulses;
}

/// The path at these pulses.
Paths one_vertex_at(const std::vector<int64_t>& pulses,
                    const std::function<Vector3f(float)>& path) {
  Paths positions;
  for (const int64_t pulse : pulses) positions.push_back({path(static_cast<float>(pulse))});
  return positions;
}

Paths one_vertex(const std::function<Vector3f(float)>& path) {
  return one_vertex_at(successive(kPulses), path);
}

/// Smooths the path at successive pulses.
void smooth(Paths& positions) { smooth_in_time(positions, successive(positions.size())); }

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
  smooth(smoothed);
  EXPECT_LT(steps(smoothed), steps(still) / 5);
}

TEST(SmoothInTime, keeps_a_path_of_steady_acceleration) {
  const Paths falling =
      one_vertex([](float t) { return Vector3f(0.03F * t, 1, 2 - 0.0078F * t * t); });
  Paths smoothed = falling;
  smooth(smoothed);
  EXPECT_LT(largest_difference(smoothed, falling), 1e-5F);
}

TEST(SmoothInTime, brings_a_noisy_moving_path_nearer_to_the_true_one) {
  const Paths truth = one_vertex([](float t) { return Vector3f(0.03F * t, 1, 0.001F * t * t); });
  const Paths noisy = with_noise(truth, 0.0005F);
  Paths smoothed = noisy;
  smooth(smoothed);
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
  smooth(smoothed);
  EXPECT_LT(largest_difference(smoothed, stops), 0.001F);
}

TEST(SmoothInTime, leaves_the_first_and_the_last_pulse_as_they_are) {
  const Paths noisy = with_noise(one_vertex([](float) { return Vector3f(0, 0, 1); }), 0.0001F);
  Paths smoothed = noisy;
  smooth(smoothed);
  EXPECT_EQ(smoothed.front(), noisy.front());
  EXPECT_EQ(smoothed.back(), noisy.back());
  EXPECT_NE(smoothed[10], noisy[10]);
}

TEST(SmoothInTime, accepts_a_segment_of_one_pulse_and_one_without_pulses) {
  Paths one{{Vector3f(1, 2, 3)}}, none;
  smooth(one);
  smooth(none);
  EXPECT_EQ(one[0][0], Vector3f(1, 2, 3));
  EXPECT_TRUE(none.empty());
}

TEST(SmoothInTime, keeps_a_steadily_moving_path_beside_a_lost_pulse) {
  std::vector<int64_t> pulses = successive(kPulses);
  pulses.erase(pulses.begin() + 10);
  const Paths moves = one_vertex_at(pulses, [](float t) { return Vector3f(0.001F * t, 0, 1); });
  Paths smoothed = moves;
  smooth_in_time(smoothed, pulses);
  EXPECT_LT(largest_difference(smoothed, moves), 1e-5F);
}

TEST(SmoothInTime, does_not_mix_the_positions_before_and_after_a_long_gap) {
  std::vector<int64_t> pulses = successive(kPulses);
  for (size_t i = 10; i < pulses.size(); ++i) pulses[i] += 25;
  // Less than the noise that a vertex may have.
  const Paths steps_aside =
      one_vertex_at(pulses, [](float t) { return Vector3f(t < 20 ? 0 : 0.0003F, 0, 1); });
  Paths smoothed = steps_aside;
  smooth_in_time(smoothed, pulses);
  EXPECT_LT(largest_difference(smoothed, steps_aside), 1e-6F);
}

TEST(SmoothInTime, smooths_where_every_second_pulse_is_lost) {
  std::vector<int64_t> pulses(kPulses);
  for (size_t i = 0; i < pulses.size(); ++i) pulses[i] = 2 * static_cast<int64_t>(i);
  const Paths still = with_noise(one_vertex([](float) { return Vector3f(0, 0, 1); }), 0.0001F);
  Paths smoothed = still;
  smooth_in_time(smoothed, pulses);
  EXPECT_LT(steps(smoothed), steps(still) / 5);
}

/// Displacements of one vertex at successive pulses, all with weight 1.
std::vector<NormalDisplacements> of_one_vertex(size_t count,
                                               const std::function<float(size_t)>& target) {
  std::vector<NormalDisplacements> pulses;
  for (size_t i = 0; i < count; ++i) pulses.push_back({{target(i)}, {1}});
  return pulses;
}

TEST(SteadyDisplacements, have_half_of_the_noise_of_single_pulses_or_less) {
  std::mt19937 random(7);
  std::normal_distribution<float> noise(0, 0.001F);
  const auto noisy = of_one_vertex(60, [&](size_t) { return 0.002F + noise(random); });
  const auto steady = steady_displacements(noisy, successive(noisy.size()));
  float before = 0, after = 0;
  for (size_t i = 4; i < 56; ++i) {
    before += (noisy[i].target[0] - 0.002F) * (noisy[i].target[0] - 0.002F);
    after += (steady[i].target[0] - 0.002F) * (steady[i].target[0] - 0.002F);
  }
  EXPECT_LT(after, before / 4);
}

TEST(SteadyDisplacements, keep_a_fold_that_comes_within_a_pulse_and_stays) {
  const auto fold = of_one_vertex(20, [](size_t i) { return i < 10 ? -0.004F : 0.004F; });
  const auto steady = steady_displacements(fold, successive(fold.size()));
  for (size_t i = 0; i < fold.size(); ++i) {
    EXPECT_NEAR(steady[i].target[0], fold[i].target[0], 1e-5F) << "pulse " << i;
  }
}

TEST(SteadyDisplacements, are_not_changed_by_one_wrong_pulse) {
  const auto wrong = of_one_vertex(11, [](size_t i) { return i == 5 ? 0.011F : 0.001F; });
  const auto steady = steady_displacements(wrong, successive(wrong.size()));
  for (size_t i = 0; i < wrong.size(); ++i) EXPECT_NEAR(steady[i].target[0], 0.001F, 1e-6F);
}

TEST(SteadyDisplacements, of_a_pulse_without_the_vertex_are_those_of_the_pulses_around_it) {
  auto pulses = of_one_vertex(9, [](size_t) { return 0.003F; });
  pulses[4] = {{0}, {0}};
  const auto steady = steady_displacements(pulses, successive(pulses.size()));
  EXPECT_NEAR(steady[4].target[0], 0.003F, 1e-6F);
  EXPECT_GT(steady[4].weight[0], 0.5F);
}

TEST(SteadyDisplacements, do_not_reach_across_a_gap_of_pulses) {
  const auto pulses = of_one_vertex(10, [](size_t i) { return i < 5 ? 0.001F : 0.002F; });
  std::vector<int64_t> numbers = successive(10);
  for (size_t i = 5; i < 10; ++i) numbers[i] += 20;
  const auto steady = steady_displacements(pulses, numbers);
  for (size_t i = 0; i < 10; ++i) EXPECT_NEAR(steady[i].target[0], pulses[i].target[0], 1e-6F);
}

TEST(SteadyDisplacements, of_a_vertex_that_no_pulse_shows_have_no_weight) {
  std::vector<NormalDisplacements> pulses(9, {{0.004F}, {0}});
  const auto steady = steady_displacements(pulses, successive(pulses.size()));
  for (const NormalDisplacements& pulse : steady) EXPECT_EQ(pulse.weight[0], 0);
}

}  // namespace
}  // namespace v3d::recon
