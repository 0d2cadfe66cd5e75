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

TEST(ShardInGroups, keeps_the_backlog_of_a_node_that_is_silent_for_a_moment) {
  SharedStudio studio(3, {.max_delay_ms = 20, .work = milliseconds(130), .groups = 3}, 14);
  studio.pulse(400);  // node 2 has a backlog of more than a second
  studio.pause(2, milliseconds(500));
  studio.pulse(50);
  ASSERT_TRUE(studio.settle());
  for (const size_t node : {0, 1}) {
    EXPECT_EQ(studio.shard(node).without_mesh(), std::vector<int64_t>()) << node;
    EXPECT_EQ(studio.file(node), range(0, 450)) << node;
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
  for (const recon::ReadySet& set : shard.pop_work()) work.push_back(set.set.pulse);
  EXPECT_EQ(work, (std::vector<int64_t>{6, 7})) << "5 is the first of its group";
}

/// Node 1 of two, after the mesh of its pulse 0. Pulse 1, of the other node, is the last one.
class LastPulseOfAnotherNode : public testing::Test {
 protected:
  LastPulseOfAnotherNode() {
    alive_.take = kTake;
    alive_.node = "recon2";
    alive_.first = 0;
    run(milliseconds(50), 0);
    recon::ReadySet set;
    set.set.pulse = 0;
    shard_.on_set(std::move(set));
    run(milliseconds(50), 0);
    shard_.on_own_mesh(mesh_of(0));
    shard_.on_pulse(1);
  }

  static wire::MeshMessage mesh_of(int64_t pulse) {
    wire::MeshMessage mesh;
    mesh.take = kTake;
    mesh.pulse = pulse;
    return mesh;
  }
  /// Advances the time. The other node lives and has processed its sets up to pulse `done`.
  void run(Duration time, int64_t done) {
    alive_.done = done;
    for (Duration passed{}; passed < time; passed += milliseconds(50)) {
      now_ += milliseconds(50);
      alive_.sent = from_ns<Realtime>(to_ns(now_));
      shard_.on_status(alive_);
      shard_.advance(now_);
      for (const wire::MeshMessage& mesh : shard_.pop_ordered()) file_.push_back(mesh.pulse);
    }
  }

  MonotonicInstant now_ = from_ns<Monotonic>(1'000'000'000);
  wire::ShardMessage alive_;
  Shard shard_{{.take = kTake, .roster = {"recon1", "recon2"}, .node = "recon1", .frame_groups = 2},
               now_};
  std::vector<int64_t> file_;
};

TEST_F(LastPulseOfAnotherNode, is_waited_for_while_that_node_works_on_it) {
  run(std::chrono::seconds(6), 0);
  EXPECT_FALSE(shard_.is_settled());
  shard_.on_mesh(mesh_of(1));
  run(milliseconds(50), 1);
  EXPECT_TRUE(shard_.is_settled());
  EXPECT_EQ(file_, range(0, 2));
}

TEST_F(LastPulseOfAnotherNode, is_kept_when_the_mesh_of_a_slow_node_arrives_after_its_status) {
  run(std::chrono::seconds(6), 0);
  run(milliseconds(50), 1);
  EXPECT_FALSE(shard_.is_settled());
  shard_.on_mesh(mesh_of(1));
  run(milliseconds(50), 1);
  EXPECT_EQ(file_, range(0, 2));
  EXPECT_EQ(shard_.counts().lost, 0);
}

TEST_F(LastPulseOfAnotherNode, is_reported_when_its_mesh_does_not_arrive) {
  run(std::chrono::seconds(3), 1);
  EXPECT_TRUE(shard_.is_settled());
  EXPECT_EQ(shard_.without_mesh(), std::vector<int64_t>{1});
}

TEST(ShardInGroups, does_not_wait_for_a_publisher_that_has_no_mesh_of_the_last_pulse) {
  MonotonicInstant now = from_ns<Monotonic>(1'000'000'000);
  Shard shard({.take = kTake, .roster = {"recon1", "recon2"}, .node = "recon2"}, now);
  wire::ShardMessage publisher;
  publisher.take = kTake;
  publisher.node = "recon1";
  publisher.first = 0;
  publisher.done = 1;
  const auto run = [&](int steps) {
    for (int i = 0; i < steps; ++i) {
      now += milliseconds(50);
      publisher.sent = from_ns<Realtime>(to_ns(now));
      shard.on_status(publisher);
      shard.advance(now);
    }
  };
  run(2);
  for (const int64_t pulse : {0, 1}) {
    wire::MeshMessage mesh;
    mesh.take = kTake;
    mesh.pulse = pulse;
    shard.on_mesh(std::move(mesh));
  }
  publisher.shown = 0;
  run(40);
  EXPECT_FALSE(shard.is_settled()) << "the publisher may still publish pulse 1";
  publisher.ordered = 1;
  run(2);
  EXPECT_TRUE(shard.is_settled());
  EXPECT_TRUE(shard.pop_to_publish().empty()) << "another node publishes";
}

TEST(ShardInGroups, reports_a_last_pulse_without_frames_as_done) {
  MonotonicInstant now = from_ns<Monotonic>(1'000'000'000);
  Shard shard({.take = kTake, .roster = {"recon1"}, .node = "recon1"}, now);
  shard.on_pulse(0);
  shard.advance(now);
  EXPECT_EQ(shard.status().done, -1);
  for (int i = 0; i < 60; ++i) shard.advance(now += milliseconds(50));
  EXPECT_EQ(shard.status().done, 0) << "the other nodes need not wait for it";
  EXPECT_EQ(shard.without_mesh(), std::vector<int64_t>{0});
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
  const auto silent = *rc::gen::inRange<size_t>(0, nodes);
  if (silent != killed) studio.pause(silent, milliseconds(*rc::gen::inRange(0, 600)));
  studio.pulse(*rc::gen::inRange(30, 60));
  RC_ASSERT(studio.settle());
  for (size_t node = 0; node < nodes; ++node) {
    if (nodes > 1 && node == killed) continue;
    RC_ASSERT(std::ranges::is_sorted(studio.file(node)));
    RC_ASSERT(accounted(studio, node) == range(0, studio.pulses()));
  }
}

}  // namespace
}  // namespace v3d::recond
