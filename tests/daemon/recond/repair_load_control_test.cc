#include "daemon/recond/repair_load_control.h"

#include <gtest/gtest.h>

#include "daemon/recond/live_queue.h"

namespace v3d::recond {
namespace {

constexpr size_t kMaxWaiting = RepairLoadControl::kMaxWaiting;

/// Pulses after a stopped repair until the next may start, with an empty queue.
int64_t pause_of(RepairLoadControl& load) {
  int64_t pulses = 0;
  while (!load.may_start(0)) ++pulses;
  return pulses;
}

TEST(RepairLoadControl, starts_a_repair_only_when_no_set_waits) {
  RepairLoadControl load;
  EXPECT_TRUE(load.may_start(0));
  EXPECT_FALSE(load.may_start(1));
  EXPECT_FALSE(load.may_start(kMaxWaiting));
  EXPECT_TRUE(load.may_start(0));
}

TEST(RepairLoadControl, stops_a_repair_long_before_the_queue_drops_sets) {
  EXPECT_FALSE(RepairLoadControl::must_stop(kMaxWaiting - 1));
  EXPECT_TRUE(RepairLoadControl::must_stop(kMaxWaiting));
  EXPECT_LE(3 * kMaxWaiting, LiveQueue<int>::Options().limit);
}

TEST(RepairLoadControl, pauses_after_a_stopped_repair_and_twice_as_long_after_the_next) {
  RepairLoadControl load;
  for (int64_t pause = RepairLoadControl::kFirstPause; pause <= RepairLoadControl::kLongestPause;
       pause *= 2) {
    load.on_stopped();
    EXPECT_EQ(pause_of(load), pause);
  }
  load.on_stopped();
  EXPECT_EQ(pause_of(load), RepairLoadControl::kLongestPause);
}

TEST(RepairLoadControl, begins_with_the_shortest_pause_again_after_a_finished_repair) {
  RepairLoadControl load;
  load.on_stopped();
  load.on_stopped();
  EXPECT_EQ(pause_of(load), 2 * RepairLoadControl::kFirstPause);
  load.on_finished();
  load.on_stopped();
  EXPECT_EQ(pause_of(load), RepairLoadControl::kFirstPause);
}

TEST(RepairLoadControl, counts_the_pause_in_pulses_also_while_sets_wait) {
  RepairLoadControl load;
  load.on_stopped();
  for (int64_t pulse = 0; pulse < RepairLoadControl::kFirstPause; ++pulse) {
    EXPECT_FALSE(load.may_start(kMaxWaiting)) << pulse;
  }
  EXPECT_TRUE(load.may_start(0));
}

}  // namespace
}  // namespace v3d::recond
