// Scenario tests of one capture node and one reconstruction node in a simulated studio.
#include <arpa/inet.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/socket.h>
#include <unistd.h>

#include <csignal>
#include <nlohmann/json.hpp>
#include <random>

#include "comparable_meshes.h"
#include "daemon/bus/bus.h"
#include "recon/pipeline/compact_frame.h"
#include "studio4.h"
#include "support/child_process.h"
#include "take/ledger/ledger.h"
#include "take/ledger/verify.h"
#include "take/logs/frame_log.h"
#include "take/logs/mesh_file.h"
#include "wire/messages.h"
#include "wire/secret_keys.h"

namespace v3d {
namespace {

using test::becomes_true;
using test::ChildProcess;
using test::Studio4;
using test::within;
using testing::AllOf;
using testing::HasSubstr;
using testing::IsEmpty;
using testing::Not;

/// 10 Hz. A host that is late by half a second then neither skips pulses nor loses frames.
class SteadyStudio4 : public Studio4 {
 protected:
  SteadyStudio4() : Studio4({.rate = "10"}) {}
};

/// Every mesh of all cameras is a closed surface with the volume of a person.
void expect_meshes_of_a_person(take::MeshFileReader& meshes) {
  recon::CompactDecoder decoder;
  int complete = 0;
  for (const int64_t pulse : meshes.pulses()) {
    const auto compact = meshes.read(pulse).value();
    ASSERT_TRUE(compact) << pulse;
    ASSERT_EQ(decoder.decode(*compact), codec::DecodeStatus::kOk) << pulse;
    const recon::CompactFrame frame = decoder.frame();
    EXPECT_EQ(std::ssize(frame.cameras) + frame.missing, 4) << pulse;
    if (frame.missing > 0) continue;  // came too late for the set, on a busy machine
    ++complete;
    EXPECT_TRUE(is_watertight(frame.mesh)) << pulse;
    EXPECT_GT(enclosed_volume(frame.mesh), 0.05) << pulse;
    EXPECT_LT(enclosed_volume(frame.mesh), 0.5) << pulse;
  }
  EXPECT_GT(complete, 0);
}

TEST_F(SteadyStudio4, records_a_complete_take_and_reconstructs_it_live) {
  constexpr int kPulses = 20;
  arm_and_start(kPulses);
  ASSERT_TRUE(reaches("cap01", "frames_written", 4 * kPulses)) << log();
  const int not_live = static_cast<int>(value("cap01", "pulses_not_live"));
  const control::Answer stopped = command(wire::CommandVerb::kStop);
  ASSERT_TRUE(stopped.done()) << text_of(stopped) << log();

  // The protocol repeats some messages: the last pulse, and commands without a reply. These do not
  // count as replays.
  for (const char* node : {"cap01", "recon01"}) {
    EXPECT_EQ(value(node, "messages_replayed"), 0) << node;
    EXPECT_EQ(value(node, "commands_replayed"), 0) << node;
  }
  const auto ledger = nlohmann::json::parse(stopped.replies.at("cap01").detail);
  EXPECT_TRUE(ledger["complete"]) << ledger;
  EXPECT_EQ(ledger["pulses"]["commanded"], kPulses);
  EXPECT_EQ(ledger["cameras"].size(), 4U);

  const take::Verification verified = verify_take(take());
  EXPECT_TRUE(verified.whole()) << verified.ledger.verdict();
  EXPECT_THAT(verified.disagreements, IsEmpty());
  EXPECT_EQ(verified.info.state, take::TakeState::kComplete);

  const auto recon = nlohmann::json::parse(stopped.replies.at("recon01").detail);
  EXPECT_EQ(recon["meshes"].get<int>() + recon["dropped"].get<int>() + not_live, kPulses) << recon;
  take::MeshFileReader meshes(take().mesh());
  EXPECT_EQ(meshes.pulses().size(), recon["meshes"]);
  EXPECT_FALSE(meshes.index_was_rebuilt());
  EXPECT_GT(recon["meshes"], 0) << "an idle machine makes a mesh of every pulse";
  expect_meshes_of_a_person(meshes);
}

/// Reconstructs a copy of the take in `folder` without the studio; the take holds all inputs.
/// Returns the path of its mesh file, which contains the live meshes before.
std::filesystem::path reconstruct_copy(const std::string& v3dctl, const take::TakePaths& take,
                                       const std::filesystem::path& folder,
                                       const std::vector<std::string>& options = {}) {
  const take::TakePaths copy{folder / "copy"};
  std::filesystem::copy(take.folder, copy.folder, std::filesystem::copy_options::recursive);
  std::vector<std::string> command = {v3dctl, "reconstruct", copy.folder};
  command.insert(command.end(), options.begin(), options.end());
  ChildProcess offline(command, folder / "v3dctl.log");
  EXPECT_EQ(offline.wait(within(120)), 0) << offline.output();
  return copy.mesh();
}

TEST_F(SteadyStudio4, reconstructs_a_recorded_take_to_the_same_bytes_as_live) {
  constexpr int kPulses = 40;  // so that the background model adapts to several pulses
  arm_and_start(kPulses);
  ASSERT_TRUE(reaches("cap01", "frames_written", 4 * kPulses)) << log();
  const control::Answer stopped = command(wire::CommandVerb::kStop);
  ASSERT_TRUE(stopped.done()) << text_of(stopped) << log();

  take::MeshFileReader live(take().mesh());
  take::MeshFileReader recorded(
      reconstruct_copy(bin("v3dctl"), take(), folder_.path(), {"--passes", "live"}));
  ASSERT_GE(live.pulses().size(), 1U) << log();
  EXPECT_EQ(recorded.pulses().size(), kPulses);
  const std::vector<int64_t> comparable = test::comparable_meshes(live);
  ASSERT_THAT(comparable, Not(IsEmpty())) << log();
  for (const int64_t pulse : comparable) {
    EXPECT_EQ(live.read(pulse).value(), recorded.read(pulse).value()) << "pulse " << pulse;
  }
  recon::CompactDecoder decoder;
  for (const wire::PulseMessage& pulse : take::read_pulses(take().pulses())) {
    const auto compact = recorded.read(pulse.pulse).value();
    ASSERT_TRUE(compact) << pulse.pulse;
    ASSERT_EQ(decoder.decode(*compact), codec::DecodeStatus::kOk) << pulse.pulse;
    EXPECT_EQ(decoder.frame().exposure, pulse.edge) << pulse.pulse;
  }
}

/// A studio that deforms the surfaces with one thread. On a busy machine, pulses at 20 Hz leave no
/// time for a pass of medium quality, and frames are too late for their set. The parameter is the
/// quality.
class DeformingStudio4 : public Studio4, public testing::WithParamInterface<const char*> {
 protected:
  DeformingStudio4()
      : Studio4({.voxel = "12mm",
                 .more = "quality = \"" + std::string(GetParam()) + "\"\nthreads = 1\n",
                 .rate = "5"}) {}
};

/// The first mesh of all cameras from this pulse on with this many passes or more; empty without
/// any.
std::optional<recon::CompactFrame> first_complete_from(take::MeshFileReader& meshes, int64_t begin,
                                                       int min_passes = 0) {
  recon::CompactDecoder decoder;
  for (const int64_t pulse : meshes.pulses()) {
    const auto compact = meshes.read(pulse).value();
    if (!compact || decoder.decode(*compact) != codec::DecodeStatus::kOk) return std::nullopt;
    const recon::CompactFrame frame = decoder.frame();
    if (pulse >= begin && frame.missing == 0 && frame.live_passes >= min_passes) return frame;
  }
  return std::nullopt;
}

TEST_P(DeformingStudio4, reconstructs_the_pulses_it_has_time_for_to_the_bytes_of_v3dctl) {
  const bool is_medium = studio_.reconstruction.quality == Quality::kMedium;
  // A busy machine has time for a pass seconds later, and is late with some frames.
  const auto has_meshes = [&] {
    if (!is_medium) return value("recon01", "meshes") >= 3;
    return value("recon01", "meshes_of_1_passes") + value("recon01", "meshes_of_2_passes") >= 3;
  };
  arm_and_start(0);
  ASSERT_TRUE(becomes_true(has_meshes, within(60))) << log();
  const control::Answer stopped = command(wire::CommandVerb::kStop);
  ASSERT_TRUE(stopped.done()) << text_of(stopped) << log();

  const auto ledger = nlohmann::json::parse(stopped.replies.at("cap01").detail);
  const auto recon = nlohmann::json::parse(stopped.replies.at("recon01").detail);
  const int not_live = static_cast<int>(value("cap01", "pulses_not_live"));
  EXPECT_EQ(recon["meshes"].get<int>() + recon["dropped"].get<int>() + not_live,
            ledger["pulses"]["commanded"].get<int>())
      << recon;
  take::MeshFileReader live(take().mesh());
  ASSERT_EQ(live.pulses().size(), recon["meshes"]);
  const auto first = first_complete_from(live, 0, is_medium ? 1 : 0);
  ASSERT_TRUE(first) << recon;
  EXPECT_LT(first->lattice.step, 0.005) << "the surface was deformed";
  // From the key frame before it on, because later bytes depend on those before.
  const int64_t key = first->pulse - first->pulse % codec::EncoderOptions().key_every;
  std::vector<std::string> options = {"--no-smoothing", "--frames",
                                      std::to_string(key) + ":" + std::to_string(first->pulse + 1)};
  if (is_medium) {
    options.insert(options.end(), {"--passes", "live"});
    EXPECT_EQ(recon["meshes_of_0_passes"].get<int>() + recon["meshes_of_1_passes"].get<int>() +
                  recon["meshes_of_2_passes"].get<int>(),
              recon["meshes"].get<int>())
        << recon;
  }
  take::MeshFileReader recorded(reconstruct_copy(bin("v3dctl"), take(), folder_.path(), options));
  EXPECT_EQ(std::ssize(recorded.pulses()), first->pulse + 1 - key);
  const auto frame = first_complete_from(recorded, first->pulse);
  ASSERT_TRUE(frame);
  EXPECT_EQ(frame->pulse, first->pulse);
  EXPECT_EQ(frame->live_passes, first->live_passes);
  EXPECT_EQ(frame->mesh.vertices, first->mesh.vertices);
  EXPECT_EQ(frame->mesh.triangles, first->mesh.triangles);
  for (const int64_t pulse : test::comparable_meshes(live)) {
    if (pulse < key || pulse > first->pulse) continue;
    EXPECT_EQ(live.read(pulse).value(), recorded.read(pulse).value()) << "pulse " << pulse;
  }
}

INSTANTIATE_TEST_SUITE_P(Quality, DeformingStudio4, testing::Values("medium", "high"),
                         [](const auto& quality) { return std::string(quality.param); });

TEST_F(SteadyStudio4, reports_the_end_of_a_train_of_known_length) {
  arm_and_start(10);
  EXPECT_TRUE(becomes_idle()) << log();
  // A busy simulator may lose frames before.
  EXPECT_EQ(log().find("after pulse 9"), std::string::npos) << "the end is no loss: " << log();
}

TEST_F(SteadyStudio4, rejects_commands_out_of_order_and_reports_what_would_be_right) {
  EXPECT_THAT(text_of(command(wire::CommandVerb::kStart)), HasSubstr("not armed"));
  EXPECT_THAT(text_of(command(wire::CommandVerb::kBackground, 1'000'000)),
              HasSubstr("expected 2 to 256"));
  ASSERT_TRUE(command(wire::CommandVerb::kArm).done()) << log();
  EXPECT_THAT(text_of(command(wire::CommandVerb::kArm)), HasSubstr("armed for kendo-07"));
  EXPECT_TRUE(command(wire::CommandVerb::kAbort).done());
  EXPECT_FALSE(std::filesystem::exists(take().folder)) << "an armed take leaves nothing behind";
}

TEST_F(SteadyStudio4, leaves_a_valid_take_after_SIGTERM_in_the_take) {
  arm_and_start(0);
  ASSERT_TRUE(reaches("cap01", "frames_written", 30)) << log();
  captured_->signal(SIGTERM);
  recond_->signal(SIGTERM);
  EXPECT_EQ(captured_->wait(within(30)), 0) << log();
  EXPECT_EQ(recond_->wait(within(30)), 0) << log();
  const take::Verification verified = verify_take(take());
  EXPECT_TRUE(verified.whole()) << verified.ledger.verdict();
  EXPECT_THAT(verified.disagreements, IsEmpty());
  EXPECT_EQ(verified.info.state, take::TakeState::kComplete);
  EXPECT_FALSE(take::MeshFileReader(take().mesh()).index_was_rebuilt());
}

TEST_F(SteadyStudio4, recovers_the_take_that_a_crash_left_open) {
  arm_and_start(0);
  ASSERT_TRUE(reaches("cap01", "frames_written", 30)) << log();
  captured_->signal(SIGKILL);
  EXPECT_EQ(captured_->wait(within(30)), 128 + SIGKILL);
  EXPECT_EQ(load_take_info(take()).state, take::TakeState::kRecording);
  start_captured();
  const auto recovered = [&] {
    return captured_->output().find("recovered take kendo-07") != std::string::npos;
  };
  ASSERT_TRUE(becomes_true(recovered, within(30))) << log();
  EXPECT_EQ(load_take_info(take()).state, take::TakeState::kRecovered);
  EXPECT_GE(verify_take(take()).ledger.cameras[0].written, 7);
}

/// The process of the trigger is suspended. It skips pulses, among them the last of the train.
TEST_F(Studio4,
       reports_skipped_pulses_and_ends_the_train_on_all_nodes_when_the_last_one_is_skipped) {
  constexpr int kPulses = 60;
  bus::Bus bus(studio_.network.lcm_url);
  bus::Subscription<wire::PulseMessage> pulses(bus, wire::kPulseChannel, 2 * kPulses);
  int64_t last = -1;
  const auto last_received = [&](MonotonicInstant deadline) {
    while (const auto pulse = pulses.wait(deadline)) last = pulse->pulse;
    return last;
  };
  arm_and_start(kPulses);
  ASSERT_TRUE(becomes_true([&] { return last_received(Monotonic::now()) >= 30; }, within(30)))
      << log();
  captured_->signal(SIGSTOP);
  // No pulse arrives now. Meanwhile the remaining edges (1.5 s) become due, and then late by more
  // than one second, after which the trigger skips them.
  last_received(Monotonic::now() + std::chrono::milliseconds(2700));
  captured_->signal(SIGCONT);

  ASSERT_TRUE(becomes_idle()) << "without a stop command\n" << log();
  last_received(Monotonic::now());  // an edge on its way is sensed after the pause
  const auto not_live = static_cast<int64_t>(value("cap01", "pulses_not_live"));
  const control::Answer stopped = command(wire::CommandVerb::kStop);
  const auto ledger = nlohmann::json::parse(stopped.replies.at("cap01").detail);
  EXPECT_FALSE(ledger["complete"]);
  EXPECT_EQ(ledger["pulses"]["commanded"], kPulses);
  EXPECT_EQ(ledger["pulses"]["sensed"], last + 1);
  // Frames of the last pulses may have been in flight when the process was suspended.
  constexpr int64_t kMaxInFlight = 4;  // 200 ms
  const auto follows_last_frame =
      AllOf(testing::Ge(last + 1 - kMaxInFlight), testing::Le(last + 1));
  ASSERT_EQ(ledger["cameras"].size(), 4U);
  for (const auto& camera : ledger["cameras"]) {
    const auto missing = camera["missing"].get<std::vector<int64_t>>();
    ASSERT_THAT(missing, Not(IsEmpty())) << "the daemon was suspended too late";
    EXPECT_THAT(missing.front(), follows_last_frame) << camera;
    EXPECT_EQ(missing.back() - missing.front() + 1, std::ssize(missing)) << camera;
    EXPECT_EQ(missing.back(), kPulses - 1) << camera;
    EXPECT_EQ(camera["suspect"].size(), 0U) << camera;
  }
  const auto recon = nlohmann::json::parse(stopped.replies.at("recon01").detail);
  EXPECT_THAT(recon["meshes"].get<int64_t>() + recon["dropped"].get<int64_t>() + not_live,
              follows_last_frame)
      << recon;
}

/// A studio with voxels that are far too small for one thread.
class OverloadedStudio4 : public Studio4 {
 protected:
  OverloadedStudio4() : Studio4({.voxel = "2mm", .more = "quality = \"live\"\nthreads = 1\n"}) {}
};

TEST_F(OverloadedStudio4, drops_whole_pulses_counts_them_and_reports_it_once) {
  bus::Bus bus(studio_.network.lcm_url);
  bus::Subscription<wire::EventMessage> events(bus, wire::kEventChannel, 256);
  bus::Subscription<wire::MeshMessage> meshes(bus, wire::kMeshChannel, 4096);
  arm_and_start(0);
  ASSERT_TRUE(reaches("cap01", "frames_written", 4 * 100)) << log();
  ASSERT_TRUE(reaches("recon01", "meshes", 1)) << log();
  ASSERT_TRUE(reaches("recon01", "dropped", 1)) << log();
  const control::Answer stopped = command(wire::CommandVerb::kStop);
  ASSERT_TRUE(stopped.done()) << text_of(stopped) << log();
  // Pulses that a busy capture node does not publish do not reach the reconstruction.
  const int64_t live = take::load_ledger(take().ledger()).cameras.at(0).published;

  const auto recon = nlohmann::json::parse(stopped.replies.at("recon01").detail);
  EXPECT_GT(recon["dropped"], 0) << recon;
  EXPECT_GT(recon["meshes"], 0) << recon;
  EXPECT_EQ(recon["meshes"].get<int64_t>() + recon["dropped"].get<int64_t>(), live) << recon;
  EXPECT_EQ(take::MeshFileReader(take().mesh()).pulses().size(), recon["meshes"]);
  // Whole pulses are dropped: a published mesh lacks a camera only where its frame was late.
  int published = 0, incomplete = 0;
  for (; const auto mesh = meshes.wait(Monotonic::now()); ++published) {
    incomplete += mesh->missing.empty() ? 0 : 1;
  }
  EXPECT_GT(published, 0);
  EXPECT_LE(incomplete, recon["frames_late"].get<int>()) << recon;
  EXPECT_EQ(recon["frames_dropped"], 0) << recon;
  EXPECT_EQ(recon["frames_lost"], 0) << recon;

  std::vector<std::string> reported;
  const auto is_recovered = [&] {
    while (const auto event = events.wait(Monotonic::now())) {
      if (event->subject == "reconstruction") reported.push_back(event->text);
    }
    return !reported.empty() && reported.back() == "the problem has ended";
  };
  EXPECT_TRUE(becomes_true(is_recovered, within(30)));
  EXPECT_THAT(reported, testing::ElementsAre(HasSubstr("cannot keep up"), "the problem has ended"));
}

/// Sends 500 random datagrams to LCM's group. Some start with LCM's magic and pass its first check.
void flood_with_datagrams(std::mt19937& random) {
  const int fd = socket(AF_INET, SOCK_DGRAM, 0);
  sockaddr_in group{};
  group.sin_family = AF_INET;
  group.sin_port = htons(7667);
  inet_pton(AF_INET, "239.255.76.67", &group.sin_addr);
  for (int i = 0; i < 500; ++i) {
    std::vector<uint8_t> noise(random() % 200 + 1);
    for (uint8_t& byte : noise) byte = static_cast<uint8_t>(random());
    const std::string magic = i % 2 == 0 ? "LC02" : "LC03";
    if (i % 3 != 0 && noise.size() > 4) std::copy(magic.begin(), magic.end(), noise.begin());
    sendto(fd, noise.data(), noise.size(), 0, reinterpret_cast<sockaddr*>(&group), sizeof group);
  }
  close(fd);
}

/// Sends random bytes and changed messages on channels that the daemons subscribe to.
void flood_channels(bus::Bus& bus, std::mt19937& random) {
  wire::CommandMessage command;
  command.sender = "stranger";
  const wire::Bytes messages[] = {encode(command), encode(wire::PulseMessage{}),
                                  encode(wire::FrameMessage{})};
  const std::string channels[] = {wire::kCommandChannel, wire::kPulseChannel,
                                  wire::frame_channel("cam01"), wire::frame_channel("nobody")};
  for (int i = 0; i < 2000; ++i) {
    wire::Bytes bytes = messages[random() % 3];
    if (i % 2 == 0) bytes.resize(random() % 300);
    for (int k = 0; k < 4 && !bytes.empty(); ++k) {
      bytes[random() % bytes.size()] = static_cast<uint8_t>(random());
    }
    bus.publish(channels[random() % 4], bytes);
  }
}

TEST_F(SteadyStudio4, counts_invalid_messages_on_every_channel_and_continues_recording) {
  arm_and_start(0);
  bus::Bus bus(studio_.network.lcm_url);
  std::mt19937 random(7);
  flood_channels(bus, random);
  flood_with_datagrams(random);
  for (const char* node : {"cap01", "recon01"}) {
    ASSERT_TRUE(reaches(node, "messages_forged", 100)) << log();
  }
  ASSERT_TRUE(captured_->runs());
  ASSERT_TRUE(recond_->runs());
  const control::Answer stopped = command(wire::CommandVerb::kStop);
  ASSERT_TRUE(stopped.done()) << text_of(stopped) << log();
  const take::Verification verified = verify_take(take());
  EXPECT_TRUE(verified.whole()) << verified.ledger.verdict();
}

TEST_F(SteadyStudio4, rejects_all_commands_without_a_studio_key_and_reports_how_to_make_one) {
  const std::filesystem::path key = studio_.network.key;
  captured_.reset();
  std::filesystem::rename(key, folder_ / "away");
  start_captured();
  const auto reports = [&](const std::string& text) {
    const auto health = client_->health(within(5));
    return health.contains("cap01") && health.at("cap01").text.find(text) != std::string::npos;
  };
  EXPECT_TRUE(becomes_true([&] { return reports("v3dctl key new"); }, within(60))) << log();
  wire::CommandMessage abort;
  abort.verb = wire::CommandVerb::kAbort;
  EXPECT_THAT(client_->command(abort, within(3)).silent, testing::Contains("cap01"));
  std::filesystem::rename(folder_ / "away", key);
  EXPECT_TRUE(command(wire::CommandVerb::kAbort).done()) << log();
}

TEST_F(SteadyStudio4, returns_the_ledger_of_a_take_after_a_restart_of_the_node_in_it) {
  arm_and_start(0);
  ASSERT_TRUE(reaches("cap01", "frames_written", 40)) << log();
  captured_->signal(SIGKILL);
  captured_->wait(within(30));
  start_captured();
  const control::Answer stopped = command(wire::CommandVerb::kStop);
  ASSERT_TRUE(stopped.done()) << text_of(stopped) << log();
  const auto ledger = nlohmann::json::parse(stopped.replies.at("cap01").detail);
  EXPECT_EQ(ledger["take"], "kendo-07");
  EXPECT_GE(ledger["cameras"][0]["written"], 7) << ledger;
  // What was lost is counted from the ledger before the restart, and no count is below zero.
  for (const auto& camera : ledger["cameras"]) {
    for (const auto& [name, count] : camera.items()) {
      EXPECT_TRUE(!count.is_number() || count.get<double>() >= 0) << name << " " << ledger;
    }
  }
  EXPECT_THAT(text_of(stopped), testing::Not(testing::ContainsRegex("(^|[ :])-[0-9]")));
}

}  // namespace
}  // namespace v3d
