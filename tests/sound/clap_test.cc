#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "pulse_signal.h"
#include "sound/level_monitor.h"

namespace v3d::sound {
namespace {

using testing::DoubleNear;
using testing::Gt;

constexpr int kRate = 48'000;

/// Adds a clap: noise that decays within 5 ms.
void add_clap(std::vector<float>& signal, size_t at, double height, std::mt19937& random) {
  std::normal_distribution<double> noise(0, height);
  for (size_t i = 0; i < 2400 && at + i < signal.size(); ++i) {
    signal[at + i] += static_cast<float>(noise(random) * std::exp(-static_cast<double>(i) / 240));
  }
}

std::optional<Clap> clap_of(const std::vector<float>& signal, size_t block) {
  ClapFinder finder(kRate);
  for (size_t at = 0; at < signal.size(); at += block) {
    finder.push(std::span(signal).subspan(at, std::min(block, signal.size() - at)));
  }
  return finder.clap();
}

TEST(ClapFinder, finds_the_onset_to_a_millisecond_in_blocks_of_any_length) {
  std::mt19937 random(1);
  std::vector<float> signal(5 * kRate);
  test::add_noise(signal, 0.003, random);
  add_clap(signal, 123'456, 0.3, random);
  for (const size_t block : {7, 480, 48'000}) {
    const auto clap = clap_of(signal, block);
    ASSERT_TRUE(clap) << block;
    EXPECT_THAT(clap->sample, DoubleNear(123'456, kRate / 1000.0)) << block;
    EXPECT_THAT(clap->rise_db, Gt(20));
  }
}

TEST(ClapFinder, prefers_the_loudest_clap) {
  std::mt19937 random(2);
  std::vector<float> signal(3 * kRate);
  add_clap(signal, 20'000, 0.1, random);
  add_clap(signal, 70'000, 0.3, random);
  add_clap(signal, 120'000, 0.1, random);
  EXPECT_THAT(clap_of(signal, 4800)->sample, DoubleNear(70'000, kRate / 1000.0));
}

TEST(ClapFinder, finds_no_clap_in_a_swelling_tone_noise_or_silence) {
  std::mt19937 random(3);
  std::vector<float> tone(3 * kRate), noise(3 * kRate);
  const std::vector<float> silence(3 * kRate);
  for (size_t i = 0; i < tone.size(); ++i) {
    const double t = static_cast<double>(i) / kRate;
    tone[i] = static_cast<float>(0.3 * t / 3 * std::sin(2 * 3.14159265 * 300 * t));
  }
  test::add_noise(noise, 0.2, random);
  EXPECT_FALSE(clap_of(tone, 4800));
  EXPECT_FALSE(clap_of(noise, 4800));
  EXPECT_FALSE(clap_of(silence, 4800));
}

}  // namespace
}  // namespace v3d::sound
