#include "daemon/recond/shard_share.h"

#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

#include <algorithm>

#include "daemon/recond/active_time_clock.h"

namespace v3d {
namespace {

/// Who is there, of one to nine; somebody is.
std::vector<bool> any_roster() {
  std::vector<bool> there(*rc::gen::inRange<size_t>(1, 10));
  for (size_t i = 0; i < there.size(); ++i) there[i] = *rc::gen::arbitrary<bool>();
  there[*rc::gen::inRange<size_t>(0, there.size())] = true;
  return there;
}

RC_GTEST_PROP(ShardShare, gives_every_pulse_to_one_who_is_there, ()) {
  const auto there = any_roster();
  const auto pulse = *rc::gen::inRange<int64_t>(0, INT64_MAX);
  RC_ASSERT(maker_of(pulse, there) < there.size());
  RC_ASSERT(there[maker_of(pulse, there)]);
}

RC_GTEST_PROP(ShardShare, moves_only_the_pulses_of_the_dead, ()) {
  const auto before = any_roster();
  const auto dead = *rc::gen::inRange<size_t>(0, before.size());
  auto after = before;
  after[dead] = false;
  RC_PRE(std::find(after.begin(), after.end(), true) != after.end());
  const bool all_lived = std::find(before.begin(), before.end(), false) == before.end();
  for (int64_t pulse = 0; pulse < 200; ++pulse) {
    const size_t maker = maker_of(pulse, before);
    // What had been a dead one's before goes round anew among those who are left.
    const bool own = maker == static_cast<size_t>(pulse) % before.size();
    if (maker != dead && (own || all_lived)) RC_ASSERT(maker_of(pulse, after) == maker);
  }
}

RC_GTEST_PROP(ShardShare, is_the_same_for_all_who_are_there_over_a_round, ()) {
  const auto there = any_roster();
  const auto count = std::count(there.begin(), there.end(), true);
  const int64_t round = static_cast<int64_t>(there.size()) * count;
  const auto first = *rc::gen::inRange<int64_t>(0, 1'000'000);
  std::vector<int64_t> shares(there.size());
  for (int64_t pulse = first; pulse < first + round; ++pulse) ++shares[maker_of(pulse, there)];
  for (size_t place = 0; place < there.size(); ++place) {
    RC_ASSERT(shares[place] == (there[place] ? static_cast<int64_t>(there.size()) : 0));
  }
}

RC_GTEST_PROP(ShardShare, lets_a_node_hear_every_group_of_its_pulses, ()) {
  const auto nodes = *rc::gen::inRange<size_t>(1, 10);
  const auto groups = *rc::gen::inRange<size_t>(1, 10);
  for (int64_t pulse = 0; pulse < 100; ++pulse) {
    const size_t maker = maker_of(pulse, std::vector<bool>(nodes, true));
    RC_ASSERT(groups_of(maker, nodes, groups).contains(FrameNumbers::group_of(pulse, groups)));
  }
}

RC_GTEST_PROP(ShardShare, lets_a_node_hear_no_pulses_of_others_in_a_multiple_of_groups, ()) {
  const auto nodes = *rc::gen::inRange<size_t>(1, 10);
  const size_t groups = nodes * *rc::gen::inRange<size_t>(1, 4);
  std::vector<int> heard(groups);
  for (size_t place = 0; place < nodes; ++place) {
    for (const size_t group : groups_of(place, nodes, groups)) ++heard[group];
  }
  RC_ASSERT(heard == std::vector<int>(groups, 1));
}

TEST(ActiveTimeClock, counts_no_time_in_which_its_loop_stood_still) {
  using std::chrono::milliseconds;
  ActiveTimeClock clock;
  MonotonicInstant now = from_ns<Monotonic>(1'000'000'000);
  EXPECT_EQ(clock.turn(now), Duration::zero());
  EXPECT_EQ(clock.turn(now += milliseconds(20)), milliseconds(20));
  EXPECT_EQ(clock.turn(now += std::chrono::seconds(30)), milliseconds(120));
  EXPECT_EQ(clock.turn(now += milliseconds(20)), milliseconds(140));
}

}  // namespace
}  // namespace v3d
