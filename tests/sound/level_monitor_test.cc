#include "sound/level_monitor.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

namespace v3d::sound {
namespace {

using testing::ElementsAre;
using testing::IsEmpty;

constexpr int kRate = 96'000;
constexpr int64_t kBlock = kRate / 100;

double ratio(double dbfs) { return std::pow(10, dbfs / 20); }

/// Two microphones on the channels 1 and 4, pulses on 2 and timecode on 3.
class LevelMonitorTest : public testing::Test {
 protected:
  void add(const std::vector<double>& dbfs, double seconds) {
    std::vector<double> peaks;
    for (const double level : dbfs) peaks.push_back(ratio(level));
    for (int64_t i = 0; i < std::llround(seconds * 100); ++i) monitor_.add(peaks, kBlock);
  }

  LevelMonitor monitor_{{.node = "cap01",
                         .device = "hw:0",
                         .channels = 4,
                         .rate_hz = kRate,
                         .pulse_channel = 2,
                         .timecode_channel = 3,
                         .timecode_rate = {}}};
};

TEST_F(LevelMonitorTest, reports_a_dead_microphone_beside_one_that_works) {
  add({-85, -6, -3, -30}, LevelMonitor::kHoldSeconds - 0.01);
  EXPECT_THAT(monitor_.faults(), IsEmpty()) << "a pause in the sound is shorter";
  add({-85, -6, -3, -30}, 0.01);
  EXPECT_THAT(monitor_.faults(), ElementsAre(ChannelFault{1, LevelFault::kSilent}));
  add({-75, -6, -3, -30}, 0.01);
  EXPECT_THAT(monitor_.faults(), IsEmpty()) << "a quiet room is no silence";
}

TEST_F(LevelMonitorTest, reports_clipping_until_five_seconds_after_the_last_peak) {
  add({-20, -6, -3, -0.2}, 1);
  EXPECT_THAT(monitor_.faults(), IsEmpty());
  add({-20, -6, -3, 0}, 0.01);
  add({-20, -6, -3, -20}, LevelMonitor::kHoldSeconds - 0.01);
  EXPECT_THAT(monitor_.faults(), ElementsAre(ChannelFault{4, LevelFault::kClips}));
  add({-20, -6, -3, -20}, 0.01);
  EXPECT_THAT(monitor_.faults(), IsEmpty());
}

TEST_F(LevelMonitorTest, ignores_the_levels_of_pulses_and_timecode) {
  add({-20, 0, 0, -20}, 6);
  EXPECT_THAT(monitor_.faults(), IsEmpty());
  add({-20, -150, -150, -20}, 6);
  EXPECT_THAT(monitor_.faults(), IsEmpty());
}

TEST_F(LevelMonitorTest, names_each_channel_with_its_fault) {
  add({0, -6, -3, -150}, 6);
  EXPECT_THAT(monitor_.faults(), ElementsAre(ChannelFault{1, LevelFault::kClips},
                                             ChannelFault{4, LevelFault::kSilent}));
}

TEST_F(LevelMonitorTest, restarts_its_counts_after_a_reset) {
  add({0, -6, -3, -150}, 6);
  monitor_.reset();
  EXPECT_THAT(monitor_.faults(), IsEmpty());
  add({-20, -6, -3, -150}, 4);
  EXPECT_THAT(monitor_.faults(), IsEmpty());
}

TEST(Decibels, of_nothing_are_the_least) {
  EXPECT_EQ(decibels_of(1), 0);
  EXPECT_NEAR(decibels_of(0.5), -6.02, 0.01);
  EXPECT_EQ(decibels_of(0), -150);
}

}  // namespace
}  // namespace v3d::sound
