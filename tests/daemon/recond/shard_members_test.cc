#include "daemon/recond/shard_members.h"

#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

#include <algorithm>

namespace v3d::recond {
namespace {

/// The availability of one to nine nodes, at least one of which is available.
std::vector<bool> any_roster() {
  std::vector<bool> available(*rc::gen::inRange<size_t>(1, 10));
  for (size_t i = 0; i < available.size(); ++i) available[i] = *rc::gen::arbitrary<bool>();
  available[*rc::gen::inRange<size_t>(0, available.size())] = true;
  return available;
}

RC_GTEST_PROP(ShardMembers, assigns_every_pulse_to_an_available_node, ()) {
  const auto available = any_roster();
  const auto pulse = *rc::gen::inRange<int64_t>(0, INT64_MAX);
  RC_ASSERT(owner_of(pulse, available) < available.size());
  RC_ASSERT(available[owner_of(pulse, available)]);
}

RC_GTEST_PROP(ShardMembers, moves_only_the_pulses_of_a_killed_node, ()) {
  const auto before = any_roster();
  const auto killed = *rc::gen::inRange<size_t>(0, before.size());
  auto after = before;
  after[killed] = false;
  RC_PRE(std::find(after.begin(), after.end(), true) != after.end());
  const bool all_available = std::find(before.begin(), before.end(), false) == before.end();
  for (int64_t pulse = 0; pulse < 200; ++pulse) {
    const size_t owner = owner_of(pulse, before);
    // Pulses of nodes that were missing before rotate again among the other nodes.
    const bool own = owner == static_cast<size_t>(pulse) % before.size();
    if (owner != killed && (own || all_available)) RC_ASSERT(owner_of(pulse, after) == owner);
  }
}

RC_GTEST_PROP(ShardMembers, is_equal_for_all_available_nodes_over_a_round, ()) {
  const auto available = any_roster();
  const auto count = std::count(available.begin(), available.end(), true);
  const int64_t round = static_cast<int64_t>(available.size()) * count;
  const auto first = *rc::gen::inRange<int64_t>(0, 1'000'000);
  std::vector<int64_t> shares(available.size());
  for (int64_t pulse = first; pulse < first + round; ++pulse) ++shares[owner_of(pulse, available)];
  for (size_t index = 0; index < available.size(); ++index) {
    RC_ASSERT(shares[index] == (available[index] ? static_cast<int64_t>(available.size()) : 0));
  }
}

RC_GTEST_PROP(ShardMembers, returns_every_group_of_a_node_s_pulses, ()) {
  const auto nodes = *rc::gen::inRange<size_t>(1, 10);
  const auto groups = *rc::gen::inRange<size_t>(1, 10);
  for (int64_t pulse = 0; pulse < 100; ++pulse) {
    const size_t owner = owner_of(pulse, std::vector<bool>(nodes, true));
    RC_ASSERT(groups_of(owner, nodes, groups).contains(bus::FrameNumbers::group_of(pulse, groups)));
  }
}

RC_GTEST_PROP(ShardMembers, assigns_each_group_to_one_node_when_nodes_divide_groups, ()) {
  const auto nodes = *rc::gen::inRange<size_t>(1, 10);
  const size_t groups = nodes * *rc::gen::inRange<size_t>(1, 4);
  std::vector<int> receivers(groups);
  for (size_t index = 0; index < nodes; ++index) {
    for (const size_t group : groups_of(index, nodes, groups)) ++receivers[group];
  }
  RC_ASSERT(receivers == std::vector<int>(groups, 1));
}

TEST(ShardMembers, accept_a_node_that_restarted_with_an_earlier_clock) {
  using std::chrono::milliseconds;
  ShardMembers members({"recon1", "recon2"}, 0);
  const auto accepts = [&](int64_t sent_s, Duration now) {
    wire::ShardMessage status;
    status.node = "recon2";
    status.sent = from_ns<Realtime>(sent_s * 1'000'000'000);
    return members.on_status(status, now);
  };
  EXPECT_TRUE(accepts(100, {}));
  EXPECT_FALSE(accepts(99, milliseconds(50))) << "the network has changed the order";
  EXPECT_TRUE(accepts(40, milliseconds(2000)));
  EXPECT_TRUE(members.is_alive(1, milliseconds(2000)));
  EXPECT_FALSE(accepts(39, milliseconds(2050)));
}

TEST(ShardMembers, keep_a_bounded_number_of_pulses_that_a_node_gives_up) {
  ShardMembers members({"recon1", "recon2"}, 0);
  wire::ShardMessage status;
  status.node = "recon2";
  for (int64_t pulse = 0; pulse < 100'000; ++pulse) status.given_up.push_back(pulse);
  ASSERT_TRUE(members.on_status(status, Duration::zero()));
  EXPECT_TRUE(members.has_given_up(1, 0));
  EXPECT_FALSE(members.has_given_up(1, 99'999));
}

TEST(ActiveTimeClock, excludes_time_in_which_the_process_was_stopped) {
  using std::chrono::milliseconds;
  ActiveTimeClock clock;
  MonotonicInstant now = from_ns<Monotonic>(1'000'000'000);
  EXPECT_EQ(clock.update(now), Duration::zero());
  EXPECT_EQ(clock.update(now += milliseconds(20)), milliseconds(20));
  EXPECT_EQ(clock.update(now += std::chrono::seconds(30)), milliseconds(120));
  EXPECT_EQ(clock.update(now += milliseconds(20)), milliseconds(140));
}

}  // namespace
}  // namespace v3d::recond
