// Nodes that share a take and hear the frames of their own share alone.
#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

#include "daemon/shared_studio.h"

namespace v3d {
namespace {

using std::chrono::milliseconds;
using test::any_network;
using test::expect_every_pulse_told;
using test::kTake;
using test::Network;
using test::range;
using test::SharedStudio;
using test::told;

TEST(ShardInGroups, hears_only_its_own_pulses_and_has_all_meshes) {
  for (const size_t groups : {3, 6}) {
    SharedStudio studio(3, {.work = milliseconds(90), .groups = groups}, 10);
    studio.pulse(150);
    ASSERT_TRUE(studio.settle());
    for (size_t node = 0; node < 3; ++node) {
      EXPECT_EQ(studio.file(node), range(0, 150));
      EXPECT_EQ(studio.shard(node).counts().made, 50);
      EXPECT_EQ(studio.shard(node).frame_groups(), groups_of(node, 3, groups));
    }
    EXPECT_EQ(studio.shown(), range(0, 150));
  }
}

TEST(ShardInGroups, loses_at_most_a_second_of_one_that_dies_and_names_it) {
  for (size_t dead = 0; dead < 3; ++dead) {
    SharedStudio studio(3, {.slowest_ms = 20, .work = milliseconds(60), .groups = 3}, 11);
    studio.pulse(50);
    studio.kill(dead);
    studio.pulse(100);
    ASSERT_TRUE(studio.settle());
    for (size_t node = 0; node < 3; ++node) {
      if (node == dead) continue;
      expect_every_pulse_told(studio, node, 0);
      const auto lost = studio.shard(node).without_mesh();
      EXPECT_LE(lost.size(), 8U) << "a third of the pulses of a second";
      for (const int64_t pulse : lost) {
        EXPECT_EQ(pulse % 3, static_cast<int64_t>(dead));
        EXPECT_LT(pulse, 75);
      }
      EXPECT_EQ(studio.shard(node).frame_groups(), (FrameGroupSet{node, dead}));
      EXPECT_GT(studio.shard(node).counts().taken_over, 10);
    }
  }
}

TEST(ShardInGroups, leaves_the_groups_of_one_that_came_back) {
  SharedStudio studio(3, {.slowest_ms = 20, .work = milliseconds(30), .groups = 3}, 12);
  studio.pulse(30);
  studio.kill(1);
  studio.pulse(40);
  studio.start_anew(1);
  studio.pulse(100);
  ASSERT_TRUE(studio.settle());
  for (size_t node = 0; node < 3; ++node) {
    EXPECT_EQ(studio.shard(node).frame_groups(), groups_of(node, 3, 3));
  }
  const int64_t first = studio.file(1).front();
  EXPECT_EQ(studio.file(1), range(first, 170));
  for (const size_t node : {0, 2}) {
    expect_every_pulse_told(studio, node, 0);
    for (const int64_t pulse : studio.shard(node).without_mesh()) EXPECT_LT(pulse, 55);
  }
}

TEST(ShardInGroups, makes_no_mesh_of_a_set_that_was_cut_when_it_joined) {
  Shard shard({.take = kTake, .roster = {"recon1", "recon2"}, .me = "recon1", .frame_groups = 2});
  MonotonicInstant now = from_ns<Monotonic>(1'000'000'000);
  const auto set_of = [](int64_t pulse, const std::vector<std::string>& missing) {
    ReadySet ready;
    ready.set.pulse = pulse;
    ready.missing = missing;
    return ready;
  };
  ShardMessage alive;
  alive.take = kTake;
  alive.node = "recon2";
  alive.first = 0;
  alive.sent = from_ns<Realtime>(1);
  shard.turn(now);
  shard.hear(alive);
  shard.turn(now += milliseconds(50));
  EXPECT_EQ(shard.frame_groups(), FrameGroupSet{0});
  for (int i = 0; i < 10; ++i) shard.turn(now += milliseconds(50));
  EXPECT_EQ(shard.frame_groups(), (FrameGroupSet{0, 1})) << "the other is silent";
  shard.add(set_of(5, {"cam02"}));
  shard.add(set_of(6, {"cam02"}));
  shard.add(set_of(7, {"cam02"}));
  shard.turn(now += milliseconds(50));
  std::vector<int64_t> work;
  for (const ReadySet& set : shard.take_work()) work.push_back(set.set.pulse);
  EXPECT_EQ(work, (std::vector<int64_t>{6, 7})) << "5 is the first of its group";
}

RC_GTEST_PROP(ShardInGroups, tells_of_every_pulse_whoever_dies_on_whatever_network, ()) {
  const auto nodes = *rc::gen::inRange<size_t>(1, 5);
  Network network = any_network();
  network.frames_lost = *rc::gen::inRange(0, 10) * 0.01;
  network.groups = *rc::gen::inRange<size_t>(1, 7);
  SharedStudio studio(nodes, network, *rc::gen::arbitrary<unsigned>());
  studio.pulse(*rc::gen::inRange(1, 40));
  const auto dead = *rc::gen::inRange<size_t>(0, nodes);
  if (nodes > 1) studio.kill(dead);
  studio.pulse(*rc::gen::inRange(30, 60));
  RC_ASSERT(studio.settle());
  for (size_t node = 0; node < nodes; ++node) {
    if (nodes > 1 && node == dead) continue;
    RC_ASSERT(std::ranges::is_sorted(studio.file(node)));
    const std::vector<int64_t> all = told(studio, node);
    RC_ASSERT(all == range(0, std::ssize(all)));
    RC_ASSERT(std::ssize(all) >= studio.pulses() - 10);
  }
}

}  // namespace
}  // namespace v3d
