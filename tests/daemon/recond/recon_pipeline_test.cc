// The live reconstruction on real multicast, with stages that throw or are slow.
#include "daemon/recond/recon_pipeline.h"

#include <arpa/inet.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/socket.h>

#include <atomic>
#include <functional>
#include <future>
#include <semaphore>

#include "base/core/error.h"
#include "base/io/file.h"
#include "base/io/unique_fd.h"
#include "daemon/bus/multicast_socket.h"
#include "recon_pipeline_on_bus.h"
#include "support/child_process.h"
#include "take/logs/mesh_file.h"
#include "wire/messages.h"

namespace v3d::recond {
namespace {

using test::becomes_true;
using test::within;

TEST(OpenSets, are_as_many_as_pulses_come_until_the_deadline) {
  EXPECT_EQ(open_sets_of(std::chrono::milliseconds(200), 25), 16) << "at least";
  EXPECT_EQ(open_sets_of(std::chrono::milliseconds(2000), 25), 51);
  EXPECT_EQ(open_sets_of(std::chrono::minutes(1), 25), 64) << "at most";
}

TEST_F(ReconPipelineOnBus, counts_a_pulse_whose_stage_throws_and_continues) {
  begin({.make_mesh = name_pulse, .encode = [](recon::FrameSetJob& work) {
           if (work.result.pulse == 3) throw InputError("the surface is too large");
           write_pulse(work);
         }});
  for (int64_t pulse = 0; pulse < 6; ++pulse) send(pulse);
  ASSERT_TRUE(becomes_true(
      [&] { return pipeline_->drained(Duration::zero()) && pipeline_->counts().meshes == 5; },
      within(30)));
  EXPECT_EQ(pipeline_->counts().failed, 1);
  EXPECT_EQ(pipeline_->counts().failure, "the surface is too large");
  EXPECT_TRUE(pipeline_->close());
  EXPECT_EQ(take::MeshFileReader(folder_ / "mesh.v3d").pulses(),
            (std::vector<int64_t>{0, 1, 2, 4, 5}));
}

TEST_F(ReconPipelineOnBus, counts_frames_and_pulses_whose_number_is_implausible) {
  begin({.make_mesh = name_pulse, .encode = write_pulse});
  send(0);
  send(1'000'000'000);
  wire::PulseMessage pulse;
  pulse.take = "kendo-07";
  pulse.pulse = 1'000'000'000;
  bus_.publish_authenticated(wire::kPulseChannel, encode(pulse));
  ASSERT_TRUE(becomes_true([&] { return pipeline_->counts().implausible == 2; }, within(30)));
  send(1);
  ASSERT_TRUE(becomes_true([&] { return pipeline_->counts().meshes == 2; }, within(30)));
}

/// Edges of hours ago exceed any time that this machine needs for a mesh.
TEST_F(ReconPipelineOnBus, reports_the_latency_of_its_meshes_since_the_edges_of_their_pulses) {
  begin({.make_mesh = name_pulse, .encode = write_pulse});
  const RealtimeInstant later = Realtime::now() - std::chrono::hours(1);
  const RealtimeInstant earlier = Realtime::now() - std::chrono::hours(2);
  const std::vector<RealtimeInstant> edges = {later, earlier, later};
  wire::PulseMessage pulse;
  pulse.take = "kendo-07";
  for (const RealtimeInstant edge : edges) {
    pulse.edge = edge;
    bus_.publish_authenticated(wire::kPulseChannel, encode(pulse));
    ++pulse.pulse;
  }
  pulse.pulse = 1'000'000'000;  // is counted after the edges were received
  bus_.publish_authenticated(wire::kPulseChannel, encode(pulse));
  ASSERT_TRUE(becomes_true([&] { return pipeline_->counts().implausible == 1; }, within(30)));
  for (int64_t i = 0; i < std::ssize(edges); ++i) send(i);
  ASSERT_TRUE(becomes_true([&] { return pipeline_->counts().meshes == 3; }, within(30)));
  EXPECT_TRUE(pipeline_->close());
  const auto ms_since = [](RealtimeInstant edge) {
    return 1e3 * to_seconds(Realtime::now() - edge);
  };
  const ReconCounts counts = pipeline_->counts();
  constexpr double kHourMs = 3'600'000;
  EXPECT_GE(counts.latency_p50_ms, kHourMs);
  EXPECT_LE(counts.latency_p50_ms, ms_since(later));
  EXPECT_GE(counts.latency_p99_ms, 2 * kHourMs);
  EXPECT_LE(counts.latency_p99_ms, ms_since(earlier));
}

TEST_F(ReconPipelineOnBus, reports_the_end_of_each_set_with_or_without_a_mesh) {
  std::atomic<int> began = 0, ended = 0;
  pipeline_.emplace(ReconPipeline::Setup{.take = "kendo-07",
                                         .mesh_file = folder_ / "mesh.v3d",
                                         .stages = {.make_mesh =
                                                        [&](recon::FrameSetJob& work) {
                                                          EXPECT_GT(began, ended);
                                                          name_pulse(work);
                                                        },
                                                    .encode =
                                                        [&](recon::FrameSetJob& work) {
                                                          EXPECT_GT(began, ended);
                                                          if (work.set.pulse == 1)
                                                            throw InputError("too large");
                                                          write_pulse(work);
                                                        }},
                                         .threads = 2,
                                         .sets = {.cameras = {"cam01"}},
                                         .warm_up = recon::FrameSet{.pulse = -7, .frames = {}},
                                         .on_set_begins = [&] { ++began; },
                                         .on_set_ends = [&] { ++ended; }},
                    bus_);
  for (int64_t pulse = 0; pulse < 3; ++pulse) send(pulse);
  ASSERT_TRUE(becomes_true([&] { return pipeline_->counts().meshes == 2; }, within(30)));
  EXPECT_TRUE(pipeline_->close());
  EXPECT_EQ(began, 4);
  EXPECT_EQ(ended, 4);
}

TEST_F(ReconPipelineOnBus, warms_up_first_without_a_mesh) {
  constexpr int64_t kBegin = -1;
  std::vector<int64_t> encoded;
  begin({.make_mesh = name_pulse,
         .encode =
             [&](recon::FrameSetJob& work) {
               encoded.push_back(work.set.pulse);
               write_pulse(work);
             },
         .begin_sequence = [&] { encoded.push_back(kBegin); }},
        recon::FrameSet{.pulse = -7, .frames = {}});
  send(0);
  ASSERT_TRUE(becomes_true([&] { return pipeline_->counts().meshes == 1; }, within(30)));
  EXPECT_TRUE(pipeline_->close());
  EXPECT_EQ(encoded, (std::vector<int64_t>{-7, kBegin, 0}));
  EXPECT_EQ(pipeline_->counts().meshes, 1);
  EXPECT_EQ(take::MeshFileReader(folder_ / "mesh.v3d").pulses(), std::vector<int64_t>{0});
}

/// A pipeline that repairs silhouettes by the function of the test.
class RepairingPipeline : public ReconPipelineOnBus {
 protected:
  void begin_repairing(decltype(LiveRepair::Setup::repair) repair) {
    pipeline_.emplace(
        ReconPipeline::Setup{
            .take = "kendo-07",
            .mesh_file = folder_ / "mesh.v3d",
            .stages = {.make_mesh =
                           [this](recon::FrameSetJob& work) {
                             reconstructed_.push_back(foreground(work.set));
                             name_pulse(work);
                           },
                       .encode = write_pulse},
            .threads = 2,
            .sets = {.cameras = {"cam01"}},
            .repair = LiveRepair::Setup{.cameras = {"cam01"},
                                        .list = folder_ / "repaired.recon01.txt",
                                        .repair = std::move(repair)},
            .on_finished_set =
                [this](recon::FrameSet& set) { finished_.push_back(foreground(set)); }},
        bus_);
  }
  static int64_t foreground(const recon::FrameSet& set) { return set.frames[0].mask->count(); }
  bool makes(int64_t meshes) {
    return becomes_true([&] { return pipeline_->counts().meshes == meshes; }, within(30));
  }
  std::vector<int64_t> reconstructed_, finished_;  ///< foreground pixels, by pulse
};

TEST_F(RepairingPipeline, reconstructs_repaired_silhouettes_and_passes_on_those_before) {
  begin_repairing([](recon::FrameSet& set, const recon::StopRequest&) {
    if (set.pulse == 1) return std::optional(recon::RepairedFrameSet());
    recon::RepairedFrameSet repaired;
    repaired.faults = {{0, recon::SilhouetteFaultKind::kMissingPiece, {0, 0, 16, 1}, 16}};
    repaired.replaced = {{"cam01", *set.frames[0].mask}};
    set.frames[0].mask->fill_row(0, 0, 16);
    return std::optional(std::move(repaired));
  });
  for (int64_t pulse = 0; pulse < 3; ++pulse) {
    send(pulse);
    ASSERT_TRUE(makes(pulse + 1));
  }
  EXPECT_TRUE(pipeline_->close());
  EXPECT_EQ(reconstructed_, (std::vector<int64_t>{16, 0, 16}));
  EXPECT_EQ(finished_, (std::vector<int64_t>{0, 0, 0}));
  EXPECT_EQ(pipeline_->counts().repair->checked, 3);
  EXPECT_EQ(pipeline_->counts().repair->repaired, 2);
  EXPECT_EQ(read_file(folder_ / "repaired.recon01.txt"), "0\n2\n");
}

TEST_F(RepairingPipeline, stops_a_repair_when_sets_wait_and_drops_no_pulse) {
  constexpr int64_t kPulses = RepairLoadControl::kMaxWaiting + 1;
  std::atomic<bool> has_begun = false;
  begin_repairing([&](recon::FrameSet&, const recon::StopRequest& should_stop) {
    has_begun = true;
    becomes_true(should_stop, within(30));
    return std::optional<recon::RepairedFrameSet>();
  });
  send(0);
  ASSERT_TRUE(becomes_true([&] { return has_begun.load(); }, within(30)));
  for (int64_t pulse = 1; pulse < kPulses; ++pulse) send(pulse);
  ASSERT_TRUE(makes(kPulses)) << "the first repair ended";
  EXPECT_TRUE(pipeline_->close());
  EXPECT_EQ(pipeline_->counts().dropped, 0);
  EXPECT_EQ(pipeline_->counts().repair->stopped, 1);
  EXPECT_EQ(pipeline_->counts().repair->unchecked, kPulses);
  EXPECT_EQ(pipeline_->counts().repair->checked, 0);
}

TEST_F(RepairingPipeline, counts_a_pulse_whose_repair_throws_as_failed) {
  begin_repairing([](recon::FrameSet& set, const recon::StopRequest&) {
    if (set.pulse == 0) throw InputError("no memory");
    return std::optional(recon::RepairedFrameSet());
  });
  send(0);
  ASSERT_TRUE(becomes_true([&] { return pipeline_->counts().failed == 1; }, within(30)));
  send(1);
  ASSERT_TRUE(makes(1));
}

/// A pipeline of medium quality with two passes, which take no time.
class DeformingPipeline : public ReconPipelineOnBus {
 protected:
  /// The test's function is called before each pass.
  void begin_deforming(std::function<void(int64_t pulse, int pass)> before_pass,
                       std::function<void()> before_colours) {
    const auto make_mesh = [this, before_pass = std::move(before_pass),
                            before_colours = std::move(before_colours)](recon::FrameSetJob& work) {
      int& passes = work.result.live_passes;
      for (; passes < work.live_passes.value(); ++passes) {
        before_pass(work.set.pulse, passes);
        if (!work.may_run_pass()) break;
      }
      passes_.push_back(passes);
      before_colours();
      name_pulse(work);
    };
    pipeline_.emplace(
        ReconPipeline::Setup{.take = "kendo-07",
                             .mesh_file = folder_ / "mesh.v3d",
                             .stages = {.make_mesh = make_mesh, .encode = write_pulse},
                             .threads = 2,
                             .sets = {.cameras = {"cam01"}},
                             .live_passes = 2},
        bus_);
  }
  bool waits(int64_t sets) {
    return becomes_true([&] { return pipeline_->counts().waiting == sets; }, within(30));
  }
  std::vector<int> passes_;  ///< by pulse
};

TEST_F(DeformingPipeline, leaves_out_passes_while_sets_wait) {
  std::counting_semaphore<> entered(0), go(0);
  begin_deforming([](int64_t, int) {},
                  [&] {
                    entered.release();
                    go.acquire();
                  });
  constexpr int64_t kPulses = 6;
  send(0);
  ASSERT_TRUE(becomes_true([&] { return entered.try_acquire(); }, within(30)));
  for (int64_t pulse = 1; pulse < kPulses; ++pulse) send(pulse);
  const bool all_wait = waits(kPulses - 1);
  go.release(kPulses);
  ASSERT_TRUE(all_wait);
  ASSERT_TRUE(becomes_true([&] { return pipeline_->counts().meshes == kPulses; }, within(30)));
  EXPECT_TRUE(pipeline_->close());
  EXPECT_EQ(passes_, (std::vector<int>{2, 0, 0, 0, 0, 2}));
  EXPECT_EQ(pipeline_->counts().by_passes, (std::vector<int64_t>{4, 0, 2}));
  EXPECT_EQ(pipeline_->counts().dropped, 0);
}

TEST_F(DeformingPipeline, stops_between_two_passes_when_a_set_arrives) {
  begin_deforming(
      [this](int64_t pulse, int pass) {
        if (pulse > 0 || pass == 0) return;
        send(1);
        EXPECT_TRUE(waits(1));
      },
      [] {});
  send(0);
  ASSERT_TRUE(becomes_true([&] { return pipeline_->counts().meshes == 2; }, within(60)));
  EXPECT_TRUE(pipeline_->close());
  EXPECT_EQ(passes_, (std::vector<int>{1, 2}));
  EXPECT_EQ(pipeline_->counts().by_passes, (std::vector<int64_t>{0, 1, 1}));
}

TEST_F(ReconPipelineOnBus, drops_whole_pulses_while_a_stage_is_slow_and_counts_them) {
  constexpr int64_t kPulses = 60;
  std::counting_semaphore<> go(0);
  begin_held(go);
  for (int64_t pulse = 0; pulse < kPulses; ++pulse) send(pulse);
  // More sets wait than the queue holds, and the stage has not finished the first.
  ASSERT_TRUE(becomes_true([&] { return pipeline_->counts().dropped >= 20; }, within(30)));
  EXPECT_TRUE(pipeline_->counts().behind);
  EXPECT_EQ(pipeline_->counts().meshes, 0);
  go.release(kPulses);
  ASSERT_TRUE(becomes_true(
      [&] {
        const ReconCounts counts = pipeline_->counts();
        return counts.meshes + counts.dropped == kPulses;
      },
      within(30)));
  EXPECT_TRUE(pipeline_->close());
  const std::vector<int64_t> pulses = take::MeshFileReader(folder_ / "mesh.v3d").pulses();
  EXPECT_EQ(std::ssize(pulses), pipeline_->counts().meshes);
  EXPECT_EQ(pulses.back(), kPulses - 1) << "the newest is never dropped";
}

TEST_F(ReconPipelineOnBus, counts_sets_that_wait_when_closed_as_dropped) {
  constexpr int64_t kPulses = 20;
  std::counting_semaphore<> go(0);
  begin_held(go);
  for (int64_t pulse = 0; pulse < kPulses; ++pulse) send(pulse);
  ASSERT_TRUE(becomes_true([&] { return pipeline_->counts().waiting == kPulses - 1; }, within(30)));
  auto closed = std::async(std::launch::async, [&] { return pipeline_->close(); });
  do {
    go.release();
  } while (closed.wait_for(std::chrono::milliseconds(10)) != std::future_status::ready);
  EXPECT_TRUE(closed.get());
  const ReconCounts counts = pipeline_->counts();
  EXPECT_EQ(counts.meshes + counts.dropped, kPulses);
  EXPECT_EQ(counts.waiting, 0);
}

/// Two nodes of one take, each with a connection and a disk of its own.
class SharedPipelines : public ReconPipelineOnBus {
 protected:
  using ReconPipelineOnBus::ReconPipelineOnBus;

  struct Node {
    explicit Node(const std::vector<std::string>& frame_groups = {}) : bus(kUrl, frame_groups) {}
    bus::Bus bus;
    std::atomic<int> sequences = 0;
    std::optional<ReconPipeline> pipeline;
  };
  /// On a busy host a thread may pause for seconds: then only `liveness_timeout` names a node that
  /// has ended.
  void begin(Node& node, const std::string& name,
             Duration liveness_timeout = std::chrono::minutes(1)) {
    node.pipeline.emplace(
        ReconPipeline::Setup{.take = "kendo-07",
                             .mesh_file = folder_ / (name + ".v3d"),
                             .stages = {.make_mesh = name_pulse,
                                        .encode = write_pulse,
                                        .begin_sequence = [&node] { ++node.sequences; }},
                             .threads = 2,
                             .sets = {.cameras = {"cam01"}},
                             .shard = Shard::Setup{.take = "kendo-07",
                                                   .roster = {"recon01", "recon02"},
                                                   .node = name,
                                                   .frame_groups = node.bus.frame_groups(),
                                                   .liveness_timeout = liveness_timeout,
                                                   .loss_timeout = std::chrono::minutes(1),
                                                   .repeat_after = std::chrono::minutes(1)}},
        node.bus);
  }
  static bool have(Node& a, Node& b, auto what) {
    return becomes_true([&] { return what(a.pipeline->counts()) && what(b.pipeline->counts()); },
                        within(30));
  }
};

TEST_F(SharedPipelines, make_half_of_the_meshes_each_and_write_all_in_order) {
  constexpr int64_t kPulses = 24;
  Node one, two;
  begin(one, "recon01");
  begin(two, "recon02");
  ASSERT_TRUE(have(one, two, [](const ReconCounts& c) { return c.shard->alive == 2; }));
  bus::Subscription<wire::MeshMessage> shown(bus_, wire::kMeshChannel, 100);
  for (int64_t pulse = 0; pulse < kPulses; ++pulse) send(pulse);
  ASSERT_TRUE(have(one, two, [](const ReconCounts& c) { return c.meshes == kPulses; }));
  for (Node* node : {&one, &two}) {
    ASSERT_TRUE(
        becomes_true([&] { return node->pipeline->drained(Duration::zero()); }, within(30)));
    const ReconCounts counts = node->pipeline->counts();
    EXPECT_EQ(counts.shard->made, kPulses / 2);
    EXPECT_EQ(counts.without_mesh, std::vector<int64_t>{});
    EXPECT_EQ(node->sequences, kPulses / 2) << "every mesh is a key frame";
    EXPECT_TRUE(node->pipeline->close());
  }
  for (int64_t pulse = 0; pulse < kPulses; ++pulse) {
    const auto mesh = shown.wait(within(5));
    ASSERT_TRUE(mesh);
    EXPECT_EQ(mesh->pulse, pulse);
    EXPECT_EQ(mesh->seq, pulse);
  }
  EXPECT_FALSE(shown.wait(Monotonic::now())) << "one node publishes them";
  EXPECT_EQ(take::MeshFileReader(folder_ / "recon01.v3d").pulses().size(), size_t{kPulses});
  EXPECT_EQ(read_file(folder_ / "recon01.v3d"), read_file(folder_ / "recon02.v3d"));
}

/// The same, with a frame group for each node.
class SharedPipelinesInGroups : public SharedPipelines {
 protected:
  SharedPipelinesInGroups() : SharedPipelines(kGroups) {}
  inline static const std::vector<std::string> kGroups = {"udpm://239.255.76.68:7668?ttl=0",
                                                          "udpm://239.255.76.69:7669?ttl=0"};
  /// One after the other: frames of two groups may overtake each other.
  bool send_and_wait(int64_t first, int64_t end, Node& node) {
    for (int64_t pulse = first; pulse < end; ++pulse) {
      send(pulse);
      if (!becomes_true([&] { return node.pipeline->counts().meshes == pulse + 1; }, within(30))) {
        return false;
      }
    }
    return true;
  }
  static int64_t frames_received(const Node& node) {
    return node.pipeline->counts().cameras.at("cam01").received;
  }
};

TEST_F(SharedPipelinesInGroups, receive_frames_of_their_own_pulses_and_get_all_meshes) {
  constexpr int64_t kPulses = 24;
  Node one(kGroups), two(kGroups);
  begin(one, "recon01");
  begin(two, "recon02");
  ASSERT_TRUE(have(one, two, [](const ReconCounts& c) { return c.shard->alive == 2; }));
  ASSERT_TRUE(send_and_wait(0, kPulses, one));
  ASSERT_TRUE(have(one, two, [](const ReconCounts& c) { return c.meshes == kPulses; }));
  for (Node* node : {&one, &two}) {
    EXPECT_EQ(frames_received(*node), kPulses / 2);
    EXPECT_EQ(node->pipeline->counts().frames_lost, 0)
        << "frames of other groups do not count as lost";
    EXPECT_EQ(node->pipeline->counts().without_mesh, std::vector<int64_t>{});
    EXPECT_TRUE(node->pipeline->close());
  }
  EXPECT_EQ(read_file(folder_ / "recon01.v3d"), read_file(folder_ / "recon02.v3d"));
}

TEST_F(SharedPipelinesInGroups, wait_for_the_last_pulse_that_the_node_of_the_trigger_reports) {
  Node one(kGroups), two(kGroups);
  begin(one, "recon01");
  begin(two, "recon02");
  ASSERT_TRUE(have(one, two, [](const ReconCounts& c) { return c.shard->alive == 2; }));
  ASSERT_TRUE(send_and_wait(0, 4, one));
  const auto is_drained = [&] { return one.pipeline->drained(Duration::zero()); };
  ASSERT_TRUE(becomes_true(is_drained, within(30)));
  one.pipeline->on_last_pulse(4);
  EXPECT_FALSE(is_drained()) << "no sense line reports pulses here";
  ASSERT_TRUE(send_and_wait(4, 5, one));
  EXPECT_TRUE(becomes_true(is_drained, within(30)));
}

TEST_F(SharedPipelinesInGroups, take_over_the_group_of_a_node_that_ended) {
  constexpr int64_t kPulses = 12;
  constexpr Duration kLivenessTimeout = std::chrono::seconds(5);
  Node one(kGroups);
  {
    Node two(kGroups);
    begin(one, "recon01", kLivenessTimeout);
    begin(two, "recon02", kLivenessTimeout);
    ASSERT_TRUE(have(one, two, [](const ReconCounts& c) { return c.shard->alive == 2; }));
    ASSERT_TRUE(send_and_wait(0, kPulses, one));
  }
  ASSERT_TRUE(becomes_true([&] { return one.pipeline->counts().shard->alive == 1; }, within(30)));
  ASSERT_TRUE(send_and_wait(kPulses, 2 * kPulses, one));
  EXPECT_EQ(one.pipeline->counts().frames_lost, 0);
  EXPECT_EQ(one.pipeline->counts().shard->taken_over, kPulses / 2);
}

TEST_F(SharedPipelinesInGroups, continue_when_a_group_cannot_be_joined_and_join_it_later) {
  Node one(kGroups);
  // Without SO_REUSEADDR, the port of the second group belongs to this socket.
  io::UniqueFd foreign = bus::udp_socket();
  sockaddr_in second{};
  second.sin_family = AF_INET;
  second.sin_port = htons(7669);
  ASSERT_EQ(inet_pton(AF_INET, "239.255.76.69", &second.sin_addr), 1);
  ASSERT_EQ(bind(foreign.get(), reinterpret_cast<const sockaddr*>(&second), sizeof second), 0);
  begin(one, "recon01");  // without other nodes, it wants all groups
  // Sent again and again, because another thread joins the group.
  const auto has_mesh_of = [&](int64_t pulse) {
    send(pulse);
    return one.pipeline->counts().meshes == pulse + 1;
  };
  ASSERT_TRUE(becomes_true([&] { return has_mesh_of(0); }, within(30)))
      << "the group that can be joined is received";
  EXPECT_THAT(one.pipeline->counts().join_failure, testing::HasSubstr("239.255.76.69"));
  foreign = io::UniqueFd();
  ASSERT_TRUE(becomes_true([&] { return has_mesh_of(1); }, within(30)))
      << "the other group is joined when it can be";
  EXPECT_EQ(one.pipeline->counts().join_failure, "");
  EXPECT_TRUE(one.pipeline->close());
}

}  // namespace
}  // namespace v3d::recond
