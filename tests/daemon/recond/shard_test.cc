// Nodes that share a take and all hear everything.
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
using test::without_returns;

TEST(Shard, shares_a_take_evenly_and_every_node_has_all_of_it) {
  SharedStudio studio(3, {.work = milliseconds(90)}, 1);
  studio.pulse(150);
  ASSERT_TRUE(studio.settle());
  for (size_t node = 0; node < 3; ++node) {
    EXPECT_EQ(studio.file(node), range(0, 150));
    const ShardCounts counts = studio.shard(node).counts();
    EXPECT_EQ(counts.made, 50);
    EXPECT_EQ(counts.taken_over + counts.repeated + counts.duplicates, 0);
    EXPECT_EQ(counts.living, 3);
  }
  EXPECT_EQ(studio.shown(), range(0, 150));
}

TEST(Shard, loses_nothing_of_a_node_that_dies) {
  for (size_t dead = 0; dead < 3; ++dead) {
    SharedStudio studio(3, {.slowest_ms = 20, .work = milliseconds(60)}, 2);
    studio.pulse(50);
    studio.kill(dead);
    studio.pulse(50);
    ASSERT_TRUE(studio.settle());
    for (size_t node = 0; node < 3; ++node) {
      if (node == dead) continue;
      EXPECT_EQ(studio.file(node), range(0, 100)) << dead;
      EXPECT_NEAR(static_cast<double>(studio.shard(node).counts().taken_over), 9, 2) << dead;
      EXPECT_EQ(studio.shard(node).counts().living, 2);
    }
    EXPECT_EQ(without_returns(studio.shown()), range(0, 100)) << dead;
    EXPECT_LE(std::ssize(studio.shown()), 101) << "at most the one on its way is shown twice";
  }
}

TEST(Shard, gives_a_share_to_a_node_that_comes_later) {
  for (const size_t late : {0, 2}) {
    SharedStudio studio(3, {.slowest_ms = 20, .work = milliseconds(30)}, 3);
    studio.pulse(30);
    studio.kill(late);
    studio.pulse(40);
    studio.start_anew(late);
    studio.pulse(100);
    ASSERT_TRUE(studio.settle());
    const int64_t first = studio.file(late).front();
    EXPECT_GT(first, 70);
    EXPECT_LE(first, 95);
    EXPECT_EQ(studio.file(late), range(first, 170));
    EXPECT_LE(std::abs(studio.shard(late).counts().made - (170 - first) / 3), 2);
    for (const size_t node : {1, late == 0 ? 2 : 0}) EXPECT_EQ(studio.file(node), range(0, 170));
    EXPECT_EQ(studio.shown(), range(0, 170)) << late;
  }
}

TEST(Shard, goes_on_when_all_but_one_have_died) {
  SharedStudio studio(3, {.work = milliseconds(10)}, 4);
  studio.pulse(20);
  studio.kill(0);
  studio.kill(2);
  studio.pulse(40);
  ASSERT_TRUE(studio.settle());
  EXPECT_EQ(studio.file(1), range(0, 60));
  EXPECT_EQ(without_returns(studio.shown()), range(0, 60));
}

TEST(Shard, passes_over_at_once_what_its_node_dropped_and_names_it) {
  SharedStudio studio(3, {.work = milliseconds(30)}, 5);
  for (const int64_t pulse : {10, 13, 21}) studio.drop(static_cast<size_t>(pulse % 3), pulse);
  studio.pulse(60);
  ASSERT_TRUE(studio.settle());
  for (size_t node = 0; node < 3; ++node) {
    EXPECT_EQ(studio.shard(node).without_mesh(), (std::vector<int64_t>{10, 13, 21}));
    EXPECT_EQ(studio.shard(node).counts().given_up, 3);
    EXPECT_EQ(studio.shard(node).counts().lost, 0);
    expect_every_pulse_told(studio, node, 0);
  }
}

TEST(Shard, takes_nobody_for_dead_because_it_stood_still_itself) {
  SharedStudio studio(3, {.work = milliseconds(30)}, 6);
  studio.pulse(25);
  for (size_t node = 0; node < 3; ++node) studio.hold_still(node, std::chrono::seconds(3));
  studio.pulse(25);
  studio.pulse(75);
  ASSERT_TRUE(studio.settle());
  for (size_t node = 0; node < 3; ++node) {
    EXPECT_EQ(studio.file(node), range(0, 125));
    EXPECT_EQ(studio.shard(node).counts().taken_over, 0);
  }
}

TEST(Shard, takes_one_back_that_was_only_slow) {
  for (size_t slow = 0; slow < 3; ++slow) {
    SharedStudio studio(3, {.work = milliseconds(20)}, 7);
    studio.pulse(25);
    studio.hold_still(slow, milliseconds(900));
    studio.pulse(100);
    ASSERT_TRUE(studio.settle());
    for (size_t node = 0; node < 3; ++node) EXPECT_EQ(studio.file(node), range(0, 125)) << slow;
    EXPECT_EQ(studio.shard(slow).counts().living, 3);
    EXPECT_EQ(without_returns(studio.shown()), range(0, 125)) << slow;
    EXPECT_GE(studio.shard(slow).counts().made, 30) << "it has its share again";
  }
}

TEST(Shard, makes_again_what_did_not_arrive) {
  SharedStudio studio(3, {.loss = 0.1, .slowest_ms = 30, .work = milliseconds(20)}, 8);
  studio.pulse(300);
  ASSERT_TRUE(studio.settle());
  int64_t repeated = 0;
  for (size_t node = 0; node < 3; ++node) {
    EXPECT_EQ(studio.file(node), range(0, 300));
    repeated += studio.shard(node).counts().repeated;
  }
  EXPECT_GT(repeated, 0);
}

TEST(Shard, names_a_pulse_that_nobody_has) {
  SharedStudio studio(2, {.work = milliseconds(20), .frames_lost = 0.4}, 9);
  studio.pulse(100);
  ASSERT_TRUE(studio.settle());
  EXPECT_GT(studio.shard(0).counts().lost, 0) << "neither node had its frames";
  EXPECT_LT(studio.shard(0).counts().lost, 40) << "one of them had those of the others";
  EXPECT_EQ(studio.file(0), studio.file(1));
}

RC_GTEST_PROP(Shard, tells_of_every_pulse_whoever_dies_on_whatever_network, ()) {
  const auto nodes = *rc::gen::inRange<size_t>(1, 5);
  const Network network = any_network();
  SharedStudio studio(nodes, network, *rc::gen::arbitrary<unsigned>());
  studio.pulse(*rc::gen::inRange(0, 40));
  const auto dead = *rc::gen::inRange<size_t>(0, nodes);
  if (nodes > 1) studio.kill(dead);
  studio.pulse(*rc::gen::inRange(30, 60));
  RC_ASSERT(studio.settle());
  for (size_t node = 0; node < nodes; ++node) {
    if (nodes > 1 && node == dead) continue;
    RC_ASSERT(studio.file(node) == range(0, studio.pulses()));
    RC_ASSERT(studio.shard(node).without_mesh().empty());
  }
  RC_ASSERT(without_returns(studio.shown()) == range(0, studio.pulses()));
}

TEST(Shard, holds_a_bounded_number_of_sets_of_others) {
  Shard shard({.take = kTake, .roster = {"recon1", "recon2"}, .me = "recon1"});
  MonotonicInstant now = from_ns<Monotonic>(1'000'000'000);
  ShardMessage alive;
  alive.take = kTake;
  alive.node = "recon2";
  alive.first = 0;
  for (int64_t pulse = 0; pulse < 600; ++pulse) {
    alive.sent += milliseconds(40);
    shard.hear(alive);
    shard.turn(now += milliseconds(40));
    ReadySet set;
    set.set.pulse = pulse;
    shard.add(std::move(set));
    for (const ReadySet& mine : shard.take_work()) shard.gave_up(mine.set.pulse);
  }
  EXPECT_EQ(shard.counts().let_go, 300 - static_cast<int64_t>(Shard::kMaxHeld));
  EXPECT_GT(shard.counts().lost, 0) << "a node that promises for ever is not waited for";
}

TEST(Shard, believes_no_stranger_and_no_other_take) {
  Shard shard({.take = kTake, .roster = {"recon1", "recon2"}, .me = "recon1"});
  ShardMessage word;
  word.take = "kendo-06";
  word.node = "recon2";
  word.first = 0;
  shard.turn(from_ns<Monotonic>(1));
  shard.hear(word);
  word.take = kTake;
  word.node = "recon9";
  shard.hear(word);
  EXPECT_EQ(shard.counts().living, 1);
  word.node = "recon2";
  shard.hear(word);
  EXPECT_EQ(shard.counts().living, 2);
  MeshMessage mesh;
  mesh.take = "kendo-06";
  shard.hear(mesh);
  shard.turn(from_ns<Monotonic>(2));
  EXPECT_TRUE(shard.take_ordered().empty());
}

}  // namespace
}  // namespace v3d
