// The whole control protocol in virtual time. V3D_SCHEDULES: how many schedules (2,000);
// V3D_SCHEDULE_SEED: plays this one alone, and prints what happens in it.
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

/// Plays it again with a trace.
std::string story_of(uint64_t seed) {
  const Outcome outcome = play_schedule(seed, true);
  std::string story = "V3D_SCHEDULE_SEED=" + std::to_string(seed) + ": " + outcome.violation + "\n";
  for (const std::string& line : outcome.trace) story += line + "\n";
  return story;
}

class Protocol : public testing::Test {
 protected:
  void SetUp() override { spdlog::set_level(spdlog::level::off); }
  void TearDown() override { spdlog::set_level(spdlog::level::info); }
};

TEST_F(Protocol, keeps_its_invariants_whatever_fails) {
  constexpr int kMostShown = 3;
  if (std::getenv("V3D_SCHEDULE_SEED") != nullptr) {
    const uint64_t seed = number_in("V3D_SCHEDULE_SEED", 0);
    std::printf("%s", story_of(seed).c_str());
    EXPECT_EQ(play_schedule(seed, false).violation, "");
    return;
  }
  const uint64_t schedules = number_in("V3D_SCHEDULES", 2000);
  Outcome sum;
  double longest_settled_s = 0, longest_idle_s = 0;
  int failed = 0;
  for (uint64_t seed = kFirstSeed; seed < kFirstSeed + schedules && failed < kMostShown; ++seed) {
    const Outcome outcome = play_schedule(seed, false);
    sum.pulses += outcome.pulses;
    sum.takes += outcome.takes;
    sum.complete += outcome.complete;
    sum.faults += outcome.faults;
    longest_settled_s = std::max(longest_settled_s, outcome.settled_s);
    longest_idle_s = std::max(longest_idle_s, outcome.idle_s);
    if (outcome.violation.empty()) continue;
    ++failed;
    ADD_FAILURE() << story_of(seed);
  }
  std::printf(
      "%llu schedules from seed %llu: %d takes, %d of them complete, %d pulses, %d faults; at rest "
      "after %.1f s, idle after %.1f s at most\n",
      static_cast<unsigned long long>(schedules), static_cast<unsigned long long>(kFirstSeed),
      sum.takes, sum.complete, sum.pulses, sum.faults, longest_settled_s, longest_idle_s);
  // Schedules in which nothing happens would prove nothing.
  EXPECT_GT(sum.takes, static_cast<int>(schedules));
  EXPECT_GT(sum.complete, static_cast<int>(schedules));
}

TEST_F(Protocol, is_played_the_same_way_again_by_the_same_seed) {
  for (const uint64_t seed : {1U, 2U, 3U}) {
    EXPECT_EQ(play_schedule(seed, true).trace, play_schedule(seed, true).trace);
  }
}

}  // namespace
}  // namespace v3d::simulation
