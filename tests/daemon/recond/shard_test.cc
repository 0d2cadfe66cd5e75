// Sharding without frame groups: every node receives all frames.
#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

#include "daemon/shared_studio.h"

namespace v3d::recond {
namespace {

using std::chrono::milliseconds;
using test::any_network;
using test::ascending;
using test::expect_all_pulses_accounted;
using test::kTake;
using test::Network;
using test::range;
using test::SharedStudio;

TEST(Shard, shares_pulses_evenly_and_every_node_gets_all_meshes) {
  SharedStudio studio(3, {.work = milliseconds(90)}, 1);
  studio.pulse(150);
  ASSERT_TRUE(studio.settle());
  for (size_t node = 0; node < 3; ++node) {
    EXPECT_EQ(studio.file(node), range(0, 150));
    const ShardCounts counts = studio.shard(node).counts();
    EXPECT_EQ(counts.made, 50);
    EXPECT_EQ(counts.taken_over + counts.repeated + counts.duplicates, 0);
    EXPECT_EQ(counts.alive, 3);
  }
  EXPECT_EQ(studio.published(), range(0, 150));
}

TEST(Shard, loses_no_pulse_when_a_node_is_killed) {
  for (size_t killed = 0; killed < 3; ++killed) {
    SharedStudio studio(3, {.max_delay_ms = 20, .work = milliseconds(60)}, 2);
    studio.pulse(50);
    studio.kill(killed);
    studio.pulse(50);
    ASSERT_TRUE(studio.settle());
    for (size_t node = 0; node < 3; ++node) {
      if (node == killed) continue;
      EXPECT_EQ(studio.file(node), range(0, 100)) << killed;
      EXPECT_NEAR(static_cast<double>(studio.shard(node).counts().taken_over), 9, 2) << killed;
      EXPECT_EQ(studio.shard(node).counts().alive, 2);
    }
    EXPECT_EQ(ascending(studio.published()), range(0, 100)) << killed;
    EXPECT_LE(std::ssize(studio.published()), 101)
        << "at most the mesh in flight is published twice";
  }
}

TEST(Shard, assigns_a_share_to_a_node_that_joins_late) {
  for (const size_t late : {0, 2}) {
    SharedStudio studio(3, {.max_delay_ms = 20, .work = milliseconds(30)}, 3);
    studio.pulse(30);
    studio.kill(late);
    studio.pulse(40);
    studio.restart(late);
    studio.pulse(100);
    ASSERT_TRUE(studio.settle());
    const int64_t first = studio.file(late).front();
    EXPECT_GT(first, 70);
    EXPECT_LE(first, 95);
    EXPECT_EQ(studio.file(late), range(first, 170));
    EXPECT_LE(std::abs(studio.shard(late).counts().made - (170 - first) / 3), 2);
    for (const size_t node : {1, late == 0 ? 2 : 0}) EXPECT_EQ(studio.file(node), range(0, 170));
    EXPECT_EQ(studio.published(), range(0, 170)) << late;
  }
}

TEST(Shard, publishes_every_pulse_when_the_publisher_before_a_late_node_is_slow) {
  SharedStudio studio(3, {.max_delay_ms = 20, .work = milliseconds(20)}, 9);
  studio.pulse(30);
  studio.kill(0);
  studio.pulse(40);
  studio.restart(0);
  studio.pulse();
  const int64_t first = studio.shard(0).status().first;
  ASSERT_GT(first, 71);
  for (int64_t pulse = first - 3; pulse < first; ++pulse) {
    studio.delay(1, pulse, std::chrono::seconds(2));
  }
  studio.pulse(99);
  ASSERT_TRUE(studio.settle());
  EXPECT_EQ(studio.file(1), range(0, 170));
  EXPECT_EQ(studio.published(), range(0, 170));
}

TEST(Shard, begins_to_publish_when_hundreds_of_meshes_wait_for_the_publisher_before) {
  MonotonicInstant now = from_ns<Monotonic>(1'000'000'000);
  Shard shard({.take = kTake, .roster = {"recon1", "recon2"}, .node = "recon1", .joins_late = true},
              now);
  wire::ShardMessage other;
  other.take = kTake;
  other.node = "recon2";
  other.first = 0;
  recon::ReadySet seen;
  seen.set.pulse = 20;
  shard.on_set(std::move(seen));
  const int64_t first = shard.status().first;
  std::vector<int64_t> published;
  for (int64_t pulse = first; pulse < first + 700; ++pulse) {
    now += milliseconds(20);
    other.sent = from_ns<Realtime>(to_ns(now));
    shard.on_status(other);
    wire::MeshMessage mesh;
    mesh.take = kTake;
    mesh.pulse = pulse;
    shard.on_mesh(mesh);
    shard.advance(now);
    for (const wire::MeshMessage& shown : shard.pop_to_publish()) published.push_back(shown.pulse);
  }
  EXPECT_EQ(published, range(first, first + 700));
}

TEST(Shard, waits_for_a_set_of_its_own_until_the_deadline_of_its_frames) {
  MonotonicInstant now = from_ns<Monotonic>(1'000'000'000);
  Shard shard({.take = kTake,
               .roster = {"recon1", "recon2"},
               .node = "recon1",
               .deadline = std::chrono::seconds(2)},
              now);
  wire::ShardMessage other;
  other.take = kTake;
  other.node = "recon2";
  other.first = 0;
  const auto run = [&](Duration time) {
    for (Duration passed{}; passed < time; passed += milliseconds(50)) {
      now += milliseconds(50);
      other.sent = from_ns<Realtime>(to_ns(now));
      shard.on_status(other);
      shard.advance(now);
    }
  };
  run(milliseconds(50));
  wire::MeshMessage mesh;
  mesh.take = kTake;
  mesh.pulse = 1;
  other.done = 1;
  shard.on_mesh(mesh);
  run(milliseconds(1900));
  EXPECT_EQ(shard.without_mesh(), std::vector<int64_t>());
  recon::ReadySet late;
  late.set.pulse = 0;
  shard.on_set(std::move(late));
  EXPECT_EQ(shard.pop_work().size(), 1U);
}

TEST(Shard, continues_with_one_node) {
  SharedStudio studio(3, {.work = milliseconds(10)}, 4);
  studio.pulse(20);
  studio.kill(0);
  studio.kill(2);
  studio.pulse(40);
  ASSERT_TRUE(studio.settle());
  EXPECT_EQ(studio.file(1), range(0, 60));
  EXPECT_EQ(ascending(studio.published()), range(0, 60));
}

TEST(Shard, skips_and_reports_pulses_that_their_owner_dropped) {
  SharedStudio studio(3, {.work = milliseconds(30)}, 5);
  for (const int64_t pulse : {10, 13, 21}) studio.drop(static_cast<size_t>(pulse % 3), pulse);
  studio.pulse(60);
  ASSERT_TRUE(studio.settle());
  for (size_t node = 0; node < 3; ++node) {
    EXPECT_EQ(studio.shard(node).without_mesh(), (std::vector<int64_t>{10, 13, 21}));
    EXPECT_EQ(studio.shard(node).counts().given_up, 3);
    EXPECT_EQ(studio.shard(node).counts().lost, 0);
    expect_all_pulses_accounted(studio, node, 0);
  }
}

TEST(Shard, keeps_other_nodes_alive_after_a_pause_of_all) {
  SharedStudio studio(3, {.work = milliseconds(30)}, 6);
  studio.pulse(25);
  for (size_t node = 0; node < 3; ++node) studio.pause(node, std::chrono::seconds(3));
  studio.pulse(25);
  studio.pulse(75);
  ASSERT_TRUE(studio.settle());
  for (size_t node = 0; node < 3; ++node) {
    EXPECT_EQ(studio.file(node), range(0, 125));
    EXPECT_EQ(studio.shard(node).counts().taken_over, 0);
  }
}

TEST(Shard, accepts_a_paused_node_again) {
  for (size_t slow = 0; slow < 3; ++slow) {
    SharedStudio studio(3, {.work = milliseconds(20)}, 7);
    studio.pulse(25);
    studio.pause(slow, milliseconds(900));
    studio.pulse(100);
    ASSERT_TRUE(studio.settle());
    for (size_t node = 0; node < 3; ++node) EXPECT_EQ(studio.file(node), range(0, 125)) << slow;
    EXPECT_EQ(studio.shard(slow).counts().alive, 3);
    EXPECT_EQ(ascending(studio.published()), range(0, 125)) << slow;
    EXPECT_GE(studio.shard(slow).counts().made, 30) << "it makes its share again";
  }
}

TEST(Shard, repeats_meshes_that_did_not_arrive) {
  SharedStudio studio(3, {.loss = 0.1, .max_delay_ms = 30, .work = milliseconds(20)}, 8);
  studio.pulse(300);
  ASSERT_TRUE(studio.settle());
  int64_t repeated = 0;
  for (size_t node = 0; node < 3; ++node) {
    EXPECT_EQ(studio.file(node), range(0, 300));
    repeated += studio.shard(node).counts().repeated;
  }
  EXPECT_GT(repeated, 0);
}

TEST(Shard, reports_pulses_that_no_node_received) {
  for (unsigned seed = 0; seed < 50; ++seed) {
    SharedStudio studio(2, {.work = milliseconds(20), .frames_lost = 0.4}, seed);
    studio.pulse(100);
    ASSERT_TRUE(studio.settle());
    EXPECT_GT(studio.shard(0).counts().lost, 0) << "neither node received its frames";
    EXPECT_LT(studio.shard(0).counts().lost, 40) << "one of the nodes received the others";
    for (size_t node = 0; node < 2; ++node) expect_all_pulses_accounted(studio, node, 0);
    // The owner of a pulse in the last second may skip it before the other node makes it.
    const auto before_the_last_second = [&](size_t node) {
      std::vector<int64_t> pulses = studio.file(node);
      std::erase_if(pulses, [](int64_t pulse) { return pulse >= 75; });
      return pulses;
    };
    EXPECT_EQ(before_the_last_second(0), before_the_last_second(1)) << "seed " << seed;
  }
}

TEST(Shard, continues_after_minutes_without_frames_while_pulses_ran) {
  constexpr int kBefore = 20, kMissed = 21'000, kAfter = 40;
  SharedStudio studio(2, {.work = milliseconds(10)}, 10);
  studio.pulse(kBefore);
  studio.miss(kMissed);
  studio.pulse(kAfter);
  ASSERT_TRUE(studio.settle());
  for (size_t node = 0; node < 2; ++node) {
    expect_all_pulses_accounted(studio, node, 0);
    EXPECT_EQ(studio.file(node).size(), size_t{kBefore + kAfter});
    EXPECT_EQ(studio.shard(node).counts().lost, kMissed);
  }
}

RC_GTEST_PROP(Shard, accounts_for_every_pulse_when_any_node_is_killed, ()) {
  const auto nodes = *rc::gen::inRange<size_t>(1, 5);
  const Network network = any_network();
  SharedStudio studio(nodes, network, *rc::gen::arbitrary<unsigned>());
  studio.pulse(*rc::gen::inRange(0, 40));
  const auto killed = *rc::gen::inRange<size_t>(0, nodes);
  if (nodes > 1) studio.kill(killed);
  studio.pulse(*rc::gen::inRange(30, 60));
  RC_ASSERT(studio.settle());
  for (size_t node = 0; node < nodes; ++node) {
    if (nodes > 1 && node == killed) continue;
    RC_ASSERT(studio.file(node) == range(0, studio.pulses()));
    RC_ASSERT(studio.shard(node).without_mesh().empty());
  }
  RC_ASSERT(ascending(studio.published()) == range(0, studio.pulses()));
}

TEST(Shard, holds_a_bounded_number_of_sets_of_others) {
  Shard shard({.take = kTake, .roster = {"recon1", "recon2"}, .node = "recon1"},
              from_ns<Monotonic>(1));
  MonotonicInstant now = from_ns<Monotonic>(1'000'000'000);
  wire::ShardMessage alive;
  alive.take = kTake;
  alive.node = "recon2";
  alive.first = 0;
  for (int64_t pulse = 0; pulse < 600; ++pulse) {
    alive.sent += milliseconds(40);
    shard.on_status(alive);
    shard.advance(now += milliseconds(40));
    recon::ReadySet set;
    set.set.pulse = pulse;
    shard.on_set(std::move(set));
    for (const recon::ReadySet& mine : shard.pop_work()) shard.give_up(mine.set.pulse);
  }
  EXPECT_EQ(shard.counts().released, 300 - static_cast<int64_t>(Shard::kMaxHeld));
  EXPECT_GT(shard.counts().lost, 0) << "the wait for a pending pulse is limited";
}

TEST(Shard, counts_and_ignores_sets_and_meshes_whose_pulse_is_implausible) {
  MonotonicInstant now = from_ns<Monotonic>(1'000'000'000);
  Shard shard({.take = kTake, .roster = {"recon1"}, .node = "recon1"}, now);
  recon::ReadySet set;
  set.set.pulse = 1'000'000'000;
  shard.on_set(set);
  wire::MeshMessage mesh;
  mesh.take = kTake;
  mesh.pulse = 1'000'000'000;
  shard.on_mesh(mesh);
  EXPECT_EQ(shard.counts().implausible, 2);
  EXPECT_EQ(shard.status().done, -1);
  set.set.pulse = 0;
  shard.on_set(set);
  EXPECT_EQ(shard.pop_work().size(), 1U);
}

TEST(Shard, ignores_unknown_nodes_and_other_takes) {
  Shard shard({.take = kTake, .roster = {"recon1", "recon2"}, .node = "recon1"},
              from_ns<Monotonic>(1));
  wire::ShardMessage status;
  status.take = "kendo-06";
  status.node = "recon2";
  status.first = 0;
  shard.advance(from_ns<Monotonic>(1));
  shard.on_status(status);
  status.take = kTake;
  status.node = "recon9";
  shard.on_status(status);
  EXPECT_EQ(shard.counts().alive, 1);
  status.node = "recon2";
  shard.on_status(status);
  EXPECT_EQ(shard.counts().alive, 2);
  wire::MeshMessage mesh;
  mesh.take = "kendo-06";
  shard.on_mesh(mesh);
  shard.advance(from_ns<Monotonic>(2));
  EXPECT_TRUE(shard.pop_ordered().empty());
}

}  // namespace
}  // namespace v3d::recond
