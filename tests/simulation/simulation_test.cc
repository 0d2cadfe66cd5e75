// Tests of the whole control protocol in virtual time. V3D_SCHEDULES: number of schedules (2,000);
// V3D_SKIPPED_SCHEDULES: number of schedules before the first one (0), so that several processes
// can share them; V3D_SCHEDULE_SEED: runs this schedule alone and prints its events.
#include <gtest/gtest.h>
#include <spdlog/spdlog.h>

#include <cstdio>
#include <cstdlib>
#include <string>

#include "simulation/schedule.h"

namespace v3d::simulation {
namespace {

constexpr uint64_t kFirstSeed = 20090219;

uint64_t number_in(const char* variable, uint64_t otherwise) {
  const char* text = std::getenv(variable);
  return text != nullptr ? std::strtoull(text, nullptr, 10) : otherwise;
}

/// Runs the schedule again with a trace, and returns violation and trace.
std::string report_of(uint64_t seed) {
  const Outcome outcome = play_schedule(seed, true);
  std::string report =
      "V3D_SCHEDULE_SEED=" + std::to_string(seed) + ": " + outcome.violation + "\n";
  for (const std::string& line : outcome.trace) report += line + "\n";
  return report;
}

class Protocol : public testing::Test {
 protected:
  void SetUp() override { spdlog::set_level(spdlog::level::off); }
  void TearDown() override { spdlog::set_level(spdlog::level::info); }
};

TEST_F(Protocol, keeps_its_invariants_under_all_faults) {
  constexpr int kMaxShown = 3;
  if (std::getenv("V3D_SCHEDULE_SEED") != nullptr) {
    const uint64_t seed = number_in("V3D_SCHEDULE_SEED", 0);
    std::printf("%s", report_of(seed).c_str());
    EXPECT_EQ(play_schedule(seed, false).violation, "");
    return;
  }
  const uint64_t schedules = number_in("V3D_SCHEDULES", 2000);
  const uint64_t first = kFirstSeed + number_in("V3D_SKIPPED_SCHEDULES", 0);
  Outcome sum;
  double longest_settled_s = 0, longest_idle_s = 0;
  int failed = 0;
  for (uint64_t seed = first; seed < first + schedules && failed < kMaxShown; ++seed) {
    const Outcome outcome = play_schedule(seed, false);
    sum.pulses += outcome.pulses;
    sum.takes += outcome.takes;
    sum.complete += outcome.complete;
    sum.faults += outcome.faults;
    longest_settled_s = std::max(longest_settled_s, outcome.settled_s);
    longest_idle_s = std::max(longest_idle_s, outcome.idle_s);
    if (outcome.violation.empty()) continue;
    ++failed;
    ADD_FAILURE() << report_of(seed);
  }
  std::printf(
      "%llu schedules from seed %llu: %d takes, %d of them complete, %d pulses, %d faults; settled "
      "after %.1f s, idle after %.1f s at most\n",
      static_cast<unsigned long long>(schedules), static_cast<unsigned long long>(first), sum.takes,
      sum.complete, sum.pulses, sum.faults, longest_settled_s, longest_idle_s);
  // Schedules without takes would prove nothing.
  EXPECT_GT(sum.takes, static_cast<int>(schedules));
  EXPECT_GT(sum.complete, static_cast<int>(schedules));
}

TEST_F(Protocol, runs_the_same_way_for_the_same_seed) {
  for (const uint64_t seed : {1U, 2U, 3U}) {
    EXPECT_EQ(play_schedule(seed, true).trace, play_schedule(seed, true).trace);
  }
}

}  // namespace
}  // namespace v3d::simulation
