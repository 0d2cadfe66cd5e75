#include "sound/pulse_edges.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

#include <cmath>

#include "pulse_signal.h"

namespace v3d::sound {
namespace {

using testing::DoubleNear;
using testing::IsEmpty;
using testing::Pointwise;
using testing::SizeIs;

constexpr int kRate = 48'000;
constexpr double kPulse = 48;  ///< 1 ms, in samples

/// Edges of `count` pulses at 25 Hz of a clock that is 80 ppm slow, from sample 777.3 on.
std::vector<double> train(int count) {
  std::vector<double> edges;
  for (int i = 0; i < count; ++i) edges.push_back(777.3 + 1920 * (1 + 80e-6) * i);
  return edges;
}

std::vector<float> signal_of(const std::vector<double>& edges, double height,
                             int64_t samples = 10 * kRate) {
  std::vector<float> signal(static_cast<size_t>(samples));
  for (const double edge : edges) test::add_pulse(signal, edge, kPulse, height);
  return signal;
}

std::vector<double> detect(const std::vector<float>& signal, size_t block = 480) {
  PulseEdgeDetector detector(kRate);
  std::vector<double> edges;
  for (size_t at = 0; at < signal.size(); at += block) {
    const auto found =
        detector.push(std::span(signal).subspan(at, std::min(block, signal.size() - at)));
    edges.insert(edges.end(), found.begin(), found.end());
  }
  const auto last = detector.finish();
  edges.insert(edges.end(), last.begin(), last.end());
  return edges;
}

TEST(PulseEdges, are_found_to_a_hundredth_of_a_sample_in_a_clean_signal) {
  const auto edges = train(249);
  EXPECT_THAT(detect(signal_of(edges, 0.5)), Pointwise(DoubleNear(0.01), edges));
}

TEST(PulseEdges, are_the_same_for_an_inverted_cable) {
  const auto edges = train(249);
  EXPECT_THAT(detect(signal_of(edges, -0.5)), Pointwise(DoubleNear(0.01), edges));
}

TEST(PulseEdges, are_found_at_40_db_of_gain_less) {
  const auto edges = train(249);
  EXPECT_THAT(detect(signal_of(edges, 0.005)), Pointwise(DoubleNear(0.01), edges));
}

TEST(PulseEdges, are_found_to_a_third_of_a_sample_in_noise_30_db_below_them) {
  const auto edges = train(249);
  auto signal = signal_of(edges, 0.5);
  std::mt19937 random(1);
  test::add_noise(signal, 0.5 * std::pow(10, -30.0 / 20), random);
  EXPECT_THAT(detect(signal), Pointwise(DoubleNear(1.0 / 3), edges));
}

TEST(PulseEdges, move_by_less_than_a_tenth_of_a_sample_when_the_input_removes_the_mean) {
  const auto edges = train(249);
  for (const double height : {0.5, -0.5}) {
    auto signal = signal_of(edges, height);
    test::remove_mean(signal, 10, kRate);
    EXPECT_THAT(detect(signal), Pointwise(DoubleNear(0.1), edges)) << height;
  }
}

TEST(PulseEdges, do_not_depend_on_the_length_of_the_blocks) {
  const auto signal = signal_of(train(249), 0.5);
  const auto edges = detect(signal, 480);
  EXPECT_EQ(detect(signal, 77), edges);
  EXPECT_EQ(detect(signal, signal.size()), edges);
}

TEST(PulseEdges, are_found_again_after_a_dropout) {
  const auto edges = train(249);
  auto signal = signal_of(edges, 0.5);
  std::fill(signal.begin() + 100'000, signal.begin() + 200'000, 0.0F);
  std::vector<double> heard;
  for (const double edge : edges) {
    if (edge < 100'000 - kPulse || edge > 200'000) heard.push_back(edge);
  }
  EXPECT_THAT(detect(signal), Pointwise(DoubleNear(0.01), heard));
}

TEST(PulseEdges, are_found_after_the_gain_was_changed_tenfold) {
  const auto edges = train(249);
  auto signal = signal_of(edges, 0.5);
  for (size_t i = 5 * kRate; i < signal.size(); ++i) signal[i] *= 0.1F;
  // The first second after the change may be missed.
  std::vector<double> late, found;
  for (const double edge : edges) {
    if (edge > 6 * kRate) late.push_back(edge);
  }
  for (const double edge : detect(signal)) {
    if (edge > 6 * kRate) found.push_back(edge);
  }
  EXPECT_THAT(found, Pointwise(DoubleNear(0.01), late));
}

TEST(PulseEdges, of_pulses_of_a_tenth_of_a_millisecond_are_found_to_a_fifth_of_a_sample) {
  std::vector<float> signal(5 * kRate);
  std::vector<double> edges;
  for (double at = 100.25; at < 5 * kRate - 100; at += kRate / 120.0) edges.push_back(at);
  for (const double edge : edges) test::add_pulse(signal, edge, 5, 0.5);
  EXPECT_THAT(detect(signal), Pointwise(DoubleNear(0.2), edges));
}

TEST(PulseEdges, at_the_borders_of_the_detectors_windows_are_found) {
  for (const double first : {47'999.25, 48'000.25, 47'960.0}) {
    std::vector<double> edges;
    for (int i = 0; i < 8; ++i) edges.push_back(first + 24'000 * i);
    EXPECT_THAT(detect(signal_of(edges, 0.5, 5 * kRate)), testing::SizeIs(testing::Ge(7U)));
    edges.clear();
    for (int i = 0; i < 100; ++i) edges.push_back(first + 1920 * i);
    EXPECT_THAT(detect(signal_of(edges, 0.5, 6 * kRate)), testing::SizeIs(testing::Ge(99U)));
  }
}

TEST(PulseEdges, of_two_pulses_per_minute_are_found) {
  const std::vector<double> edges = {10'000.5, 1'450'000.25};
  EXPECT_THAT(detect(signal_of(edges, 0.5, 32 * kRate)), Pointwise(DoubleNear(0.01), edges));
}

TEST(PulseEdges, are_not_found_in_silence_noise_or_hum) {
  std::vector<float> signal(10 * kRate);
  EXPECT_THAT(detect(signal), IsEmpty());
  std::mt19937 random(2);
  test::add_noise(signal, 0.05, random);
  EXPECT_THAT(detect(signal), IsEmpty());
  for (size_t i = 0; i < signal.size(); ++i) {
    signal[i] +=
        0.4F * static_cast<float>(std::sin(2 * 3.14159265 * 50 * static_cast<double>(i) / kRate));
  }
  EXPECT_THAT(detect(signal), IsEmpty());
}

RC_GTEST_PROP(PulseEdgesProperty, are_found_at_any_position_height_and_polarity, ()) {
  const double height = *rc::gen::inRange(20, 900) * 1e-3 * (*rc::gen::arbitrary<bool>() ? 1 : -1);
  const double first = *rc::gen::inRange(100'000, 300'000) * 1e-2;
  const double period = *rc::gen::inRange(40'000, 400'000) * 1e-2;
  std::vector<double> edges;
  for (double at = first; at < 2 * kRate - 200; at += period) edges.push_back(at);
  const auto found = detect(signal_of(edges, height, 2 * kRate));
  RC_ASSERT(found.size() == edges.size());
  for (size_t i = 0; i < found.size(); ++i) RC_ASSERT(std::abs(found[i] - edges[i]) < 0.02);
}

}  // namespace
}  // namespace v3d::sound
