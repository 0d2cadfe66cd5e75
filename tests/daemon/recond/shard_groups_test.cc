// Sharding with frame groups: every node receives only the frames of its own pulses.
#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

#include "daemon/shared_studio.h"

namespace v3d::recond {
namespace {

using std::chrono::milliseconds;
using test::accounted;
using test::any_network;
using test::expect_all_pulses_accounted;
using test::kTake;
using test::Network;
using test::range;
using test::SharedStudio;

TEST(ShardInGroups, receives_only_its_own_pulses_and_gets_all_meshes) {
  for (const size_t groups : {3, 6}) {
    SharedStudio studio(3, {.work = milliseconds(90), .groups = groups}, 10);
    studio.pulse(150);
    ASSERT_TRUE(studio.settle());
    for (size_t node = 0; node < 3; ++node) {
      EXPECT_EQ(studio.file(node), range(0, 150));
      EXPECT_EQ(studio.shard(node).counts().made, 50);
      EXPECT_EQ(studio.shard(node).frame_groups(), groups_of(node, 3, groups));
    }
    EXPECT_EQ(studio.published(), range(0, 150));
  }
}

TEST(ShardInGroups, loses_and_reports_at_most_a_second_of_a_killed_node) {
  for (size_t killed = 0; killed < 3; ++killed) {
    SharedStudio studio(3, {.max_delay_ms = 20, .work = milliseconds(60), .groups = 3}, 11);
    studio.pulse(50);
    studio.kill(killed);
    studio.pulse(100);
    ASSERT_TRUE(studio.settle());
    for (size_t node = 0; node < 3; ++node) {
      if (node == killed) continue;
      expect_all_pulses_accounted(studio, node, 0);
      const auto lost = studio.shard(node).without_mesh();
      EXPECT_LE(lost.size(), 8U) << "a third of the pulses of a second";
      for (const int64_t pulse : lost) {
        EXPECT_EQ(pulse % 3, static_cast<int64_t>(killed));
        EXPECT_LT(pulse, 75);
      }
      EXPECT_EQ(studio.shard(node).frame_groups(), (bus::FrameGroupSet{node, killed}));
      EXPECT_GT(studio.shard(node).counts().taken_over, 10);
    }
  }
}

TEST(ShardInGroups, leaves_the_groups_of_a_node_that_restarted) {
  SharedStudio studio(3, {.max_delay_ms = 20, .work = milliseconds(30), .groups = 3}, 12);
  studio.pulse(30);
  studio.kill(1);
  studio.pulse(40);
  studio.restart(1);
  studio.pulse(100);
  ASSERT_TRUE(studio.settle());
  for (size_t node = 0; node < 3; ++node) {
    EXPECT_EQ(studio.shard(node).frame_groups(), groups_of(node, 3, 3));
  }
  const int64_t first = studio.file(1).front();
  EXPECT_EQ(studio.file(1), range(first, 170));
  for (const size_t node : {0, 2}) {
    expect_all_pulses_accounted(studio, node, 0);
    for (const int64_t pulse : studio.shard(node).without_mesh()) EXPECT_LT(pulse, 55);
  }
}

TEST(ShardInGroups, makes_no_mesh_of_a_set_truncated_by_joining) {
  MonotonicInstant now = from_ns<Monotonic>(1'000'000'000);
  Shard shard({.take = kTake, .roster = {"recon1", "recon2"}, .node = "recon1", .frame_groups = 2},
              now);
  const auto set_of = [](int64_t pulse, const std::vector<std::string>& missing) {
    recon::ReadySet ready;
    ready.set.pulse = pulse;
    ready.missing = missing;
    return ready;
  };
  wire::ShardMessage alive;
  alive.take = kTake;
  alive.node = "recon2";
  alive.first = 0;
  alive.sent = from_ns<Realtime>(1);
  shard.advance(now);
  shard.on_status(alive);
  shard.advance(now += milliseconds(50));
  EXPECT_EQ(shard.frame_groups(), bus::FrameGroupSet{0});
  for (int i = 0; i < 10; ++i) shard.advance(now += milliseconds(50));
  EXPECT_EQ(shard.frame_groups(), (bus::FrameGroupSet{0, 1})) << "the other node is silent";
  shard.on_set(set_of(5, {"cam02"}));
  shard.on_set(set_of(6, {"cam02"}));
  shard.on_set(set_of(7, {"cam02"}));
  shard.advance(now += milliseconds(50));
  std::vector<int64_t> work;
  for (const recon::ReadySet& set : shard.take_work()) work.push_back(set.set.pulse);
  EXPECT_EQ(work, (std::vector<int64_t>{6, 7})) << "5 is the first of its group";
}

RC_GTEST_PROP(ShardInGroups, accounts_for_every_pulse_when_any_node_is_killed, ()) {
  const auto nodes = *rc::gen::inRange<size_t>(1, 5);
  Network network = any_network();
  network.frames_lost = *rc::gen::inRange(0, 10) * 0.01;
  network.groups = *rc::gen::inRange<size_t>(1, 7);
  SharedStudio studio(nodes, network, *rc::gen::arbitrary<unsigned>());
  studio.pulse(*rc::gen::inRange(1, 40));
  const auto killed = *rc::gen::inRange<size_t>(0, nodes);
  if (nodes > 1) studio.kill(killed);
  studio.pulse(*rc::gen::inRange(30, 60));
  RC_ASSERT(studio.settle());
  for (size_t node = 0; node < nodes; ++node) {
    if (nodes > 1 && node == killed) continue;
    RC_ASSERT(std::ranges::is_sorted(studio.file(node)));
    const std::vector<int64_t> all = accounted(studio, node);
    RC_ASSERT(all == range(0, std::ssize(all)));
    RC_ASSERT(std::ssize(all) >= studio.pulses() - 10);
  }
}

}  // namespace
}  // namespace v3d::recond
