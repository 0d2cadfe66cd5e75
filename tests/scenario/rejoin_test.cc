// Scenario tests of daemons that are killed and restarted during a take.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <csignal>
#include <nlohmann/json.hpp>

#include "recon/pipeline/compact_frame.h"
#include "sim/cameras/exposure_record.h"
#include "studio4.h"
#include "take/ledger/verify.h"
#include "take/logs/mesh_file.h"
#include "take/take_transfer.h"
#include "v3d-sim/sim_commands.h"

namespace v3d {
namespace {

using test::ChildProcess;
using test::kEmptyPulses;
using test::Studio4;
using test::within;
using testing::IsEmpty;
using testing::IsSubsetOf;

using Pulses = std::vector<int64_t>;

Pulses range(int64_t first, int64_t last) {
  Pulses pulses;
  for (int64_t pulse = first; pulse <= last; ++pulse) pulses.push_back(pulse);
  return pulses;
}

/// cap01 with the trigger, cap02 with sound, and recon01. 10 Hz, so that a busy machine loses no
/// frame.
class StudioOfThree : public Studio4 {
 protected:
  StudioOfThree()
      : Studio4({.more = "[[sound]]\nnode = 'cap02'\ndevice = 'simulated:'\n",
                 .rate = "10",
                 .two_nodes = true}) {}

  static void end(std::optional<ChildProcess>& daemon, int signal) {
    daemon->signal(signal);
    EXPECT_EQ(daemon->wait(within(30)), signal == SIGKILL ? 128 + SIGKILL : 0) << daemon->output();
  }
  /// Records a take, during which cap02 gets `signal` and is restarted; then stops the take.
  void record_with_a_restart_of_cap02(int signal) {
    arm_and_start(0);
    ASSERT_TRUE(reaches("cap02", "frames_written", 50)) << log();
    end(second_captured_, signal);
    start_second_captured();
    client_.emplace(studio_);                        // drops the health from before the restart
    for (const char* camera : {"cam03", "cam04"}) {  // one may be opened seconds after the other
      ASSERT_TRUE(reaches("cap02", std::string(camera) + ".frames_per_second", 5)) << log();
    }
    ASSERT_TRUE(cap02_writes_certain_frames()) << log();
    stopped_ = command(wire::CommandVerb::kStop);
    ASSERT_TRUE(stopped_.done()) << text_of(stopped_) << log();
  }
  /// Waits up to 60 s until cap02 has written kCertain frames in a row none of which is suspect. A
  /// busy machine delivers frames late, so that their arrival confirms no pulse number.
  bool cap02_writes_certain_frames() {
    double suspect = -1, written = 0;
    const auto are_certain = [&] {
      const double now_suspect = value("cap02", "frames_suspect");
      const double now_written = value("cap02", "frames_written");
      if (now_suspect != suspect) written = now_written;
      suspect = now_suspect;
      return now_written >= written + kCertain;
    };
    return test::becomes_true(are_certain, within(60));
  }
  /// Joins the parts of both nodes and compares them with the simulator's record of all exposures.
  /// At most `max_unsensed` of the last pulses were commanded and not sensed.
  void check_joined(int64_t max_unsensed = 0) {
    const take::TakePaths whole{folder_ / "joined"};
    join_parts({take(), {folder_ / "cap02" / take_name_}}, whole);
    verified_ = verify_take(whole);
    EXPECT_THAT(verified_.disagreements, IsEmpty());
    ASSERT_EQ(verified_.ledger.cameras.size(), 4U);
    ASSERT_TRUE(verified_.ledger.sensed);
    EXPECT_GE(*verified_.ledger.sensed, verified_.ledger.commanded - max_unsensed);
    EXPECT_LE(*verified_.ledger.sensed, verified_.ledger.commanded);
    const auto exposures = sim::load_exposures(folder_ / "exposures.csv");
    const sim::TakeCheck check = sim::check_take(whole.folder, exposures);
    EXPECT_EQ(check.mislabelled_not_suspect, 0) << testing::PrintToString(check.problems);
    EXPECT_EQ(check.frames_repeated, 0) << testing::PrintToString(check.problems);
    EXPECT_EQ(check.images_wrong, 0) << testing::PrintToString(check.problems);
  }
  /// The sound of before and of after the restart has a map of its pulses, one beside the other.
  void expect_sound_in_two_files() const {
    const auto& sounds = verified_.ledger.sounds;
    ASSERT_EQ(sounds.size(), 2U);
    EXPECT_EQ(sounds[0].file, "sound/cap02.wav");
    EXPECT_EQ(sounds[1].file, "sound/cap02.0001.wav");
    for (const take::SoundLedger& sound : sounds) {
      EXPECT_EQ(sound.map_source, "time stamps") << sound.file;
      ASSERT_TRUE(sound.map.is_known()) << sound.file;
      EXPECT_GT(sound.map.sample_of(verified_.ledger.commanded), 0) << sound.file;
    }
    EXPECT_LE(sounds[0].map.knots.back().pulse, sounds[1].map.knots.front().pulse);
  }
  /// Live meshes of complete frame sets after pulse `after` equal those that v3dctl makes of the
  /// recorded frames. This shows that the segmenters continued with their state of before.
  void check_live_meshes(int64_t after) {
    const take::TakePaths copy{folder_ / "copy"};
    std::filesystem::copy(folder_ / "joined", copy.folder,
                          std::filesystem::copy_options::recursive);
    ChildProcess offline({bin("v3dctl"), "reconstruct", copy.folder, "--passes", "live"},
                         folder_ / "v3dctl.log");
    constexpr int kIncomplete = 3;  // exit status; frame sets of the gap lack cameras
    ASSERT_EQ(offline.wait(within(120)), kIncomplete) << offline.output();
    take::MeshFileReader live(folder_ / "joined" / "mesh.v3d");
    take::MeshFileReader recorded(copy.mesh());
    int same = 0;
    recon::CompactDecoder seen, made;
    for (const int64_t pulse : recorded.pulses()) {
      ASSERT_EQ(made.decode(recorded.read(pulse).value().value()), codec::DecodeStatus::kOk);
      const auto bytes = live.read(pulse).value();
      if (!bytes) continue;
      ASSERT_EQ(seen.decode(*bytes), codec::DecodeStatus::kOk);
      if (pulse <= after || seen.frame().cameras.size() < 4) continue;
      // Up to the next key frame, colours may be predicted from other frames than offline.
      EXPECT_EQ(seen.frame().mesh.vertices, made.frame().mesh.vertices) << "pulse " << pulse;
      EXPECT_EQ(seen.frame().mesh.triangles, made.frame().mesh.triangles) << "pulse " << pulse;
      ++same;
    }
    EXPECT_GE(same, 5);
  }
  void expect_all_become_idle() {
    const auto is_idle = [&](const char* node) {
      const auto health = client_->health(within(5));
      return health.contains(node) && health.at(node).state == wire::NodeState::kIdle;
    };
    for (const char* node : {"cap01", "cap02", "recon01"}) {
      EXPECT_TRUE(test::becomes_true([&] { return is_idle(node); }, within(60))) << node << log();
    }
  }
  /// The camera has exactly one gap, and no other loss. A busy machine may deliver frames after it
  /// late. These are suspect, and their numbers may be wrong, until arrival times have confirmed
  /// the pulse number (PulseMatcher).
  void expect_one_gap(const take::CameraLedger& camera) const {
    ASSERT_THAT(camera.missing, testing::Not(IsEmpty())) << camera.name;
    const int64_t first = camera.missing.front();
    int64_t last = first;
    while (std::ranges::binary_search(camera.missing, last + 1)) ++last;
    const std::vector<int64_t> unsure = range(last + 1, verified_.ledger.commanded - kCertain / 4);
    EXPECT_GE(first, 20) << camera.name;
    EXPECT_LT(last, verified_.ledger.commanded - 10) << camera.name;
    EXPECT_THAT(std::vector(camera.missing.begin() + (last - first + 1), camera.missing.end()),
                IsSubsetOf(unsure))
        << camera.name;
    EXPECT_THAT(camera.duplicate, IsSubsetOf(camera.suspect)) << camera.name;
    EXPECT_THAT(camera.suspect, IsSubsetOf(unsure)) << camera.name;
    EXPECT_EQ(camera.written - std::ssize(camera.duplicate) + std::ssize(camera.missing),
              verified_.ledger.commanded);
  }

  /// Frames of the two cameras of cap02.
  static constexpr int64_t kCertain = 40;

  control::Answer stopped_;
  take::Verification verified_;
};

TEST_F(StudioOfThree,
       continues_with_a_node_that_was_killed_in_the_take_and_names_the_missing_pulses) {
  record_with_a_restart_of_cap02(SIGKILL);
  check_joined();
  const auto& cameras = verified_.ledger.cameras;
  for (const size_t i : {0, 1}) EXPECT_THAT(cameras[i].missing, IsEmpty()) << cameras[i].name;
  for (const size_t i : {2, 3}) expect_one_gap(cameras[i]);
  const auto replied = nlohmann::json::parse(stopped_.replies.at("cap02").detail);
  EXPECT_EQ(replied["cameras"][1]["missing"].get<Pulses>(), cameras[3].missing)
      << "as in the reply to stop";
  check_live_meshes(cameras[3].missing.back());
  expect_sound_in_two_files();
}

TEST_F(StudioOfThree, continues_with_a_node_that_was_restarted_by_SIGTERM_in_the_take) {
  record_with_a_restart_of_cap02(SIGTERM);
  check_joined();
  for (const size_t i : {2, 3}) expect_one_gap(verified_.ledger.cameras.at(i));
  expect_sound_in_two_files();
}

TEST_F(StudioOfThree, continues_to_reconstruct_after_the_reconstruction_was_killed_in_the_take) {
  arm_and_start(0);
  ASSERT_TRUE(reaches("recon01", "meshes", 20)) << log();
  end(recond_, SIGKILL);
  const std::vector<int64_t> until_killed = take::MeshFileReader(take().mesh()).pulses();
  ASSERT_GE(std::ssize(until_killed), 19) << "one may not be written whole";
  start_recond();
  client_.emplace(studio_);
  ASSERT_TRUE(reaches("recon01", "meshes", static_cast<double>(until_killed.size() + 10))) << log();
  const double before = value("recon01", "meshes");
  ASSERT_TRUE(reaches("recon01", "meshes", before + 20)) << log();
  const control::Answer stopped = command(wire::CommandVerb::kStop);
  ASSERT_TRUE(stopped.done()) << text_of(stopped) << log();

  const auto recon = nlohmann::json::parse(stopped.replies.at("recon01").detail);
  take::MeshFileReader meshes(take().mesh());
  EXPECT_FALSE(meshes.index_was_rebuilt());
  EXPECT_EQ(std::ssize(meshes.pulses()), recon["meshes"].get<int64_t>());
  EXPECT_GE(before, 20) << "the file keeps the meshes from before the restart";
  EXPECT_THAT(until_killed, IsSubsetOf(meshes.pulses()));
  for (const int64_t pulse : meshes.pulses()) EXPECT_TRUE(meshes.read(pulse).value()) << pulse;
  check_joined();
  for (const take::CameraLedger& camera : verified_.ledger.cameras) {
    EXPECT_THAT(camera.missing, IsEmpty()) << "the capture nodes are not affected";
  }
}

TEST_F(StudioOfThree, ends_the_take_on_all_nodes_when_the_node_of_the_trigger_is_killed) {
  arm_and_start(0);
  ASSERT_TRUE(reaches("cap02", "frames_written", 60)) << log();
  end(captured_, SIGKILL);
  start_captured();
  expect_all_become_idle();
  const control::Answer stopped = command(wire::CommandVerb::kStop);
  ASSERT_TRUE(stopped.done()) << text_of(stopped) << log();
  check_joined(1);
  for (const take::CameraLedger& camera : verified_.ledger.cameras) {
    EXPECT_GE(camera.written, 20) << camera.name;
    // The node may have been killed before it reported a pulse, which was exposed.
    EXPECT_THAT(camera.suspect, testing::Each(testing::Ge(*verified_.ledger.sensed)))
        << camera.name;
  }
}

TEST_F(StudioOfThree, replies_about_a_take_that_had_ended_before_all_daemons_were_restarted) {
  constexpr int64_t kPulses = 20;
  arm_and_start(kPulses);
  ASSERT_TRUE(reaches("cap01", "frames_written", 2 * kPulses)) << log();
  expect_all_become_idle();
  for (auto* daemon : {&captured_, &second_captured_, &recond_}) end(*daemon, SIGTERM);
  start_captured();
  start_second_captured();
  start_recond();
  client_.emplace(studio_);
  expect_all_become_idle();

  const control::Answer stopped = command(wire::CommandVerb::kStop);
  ASSERT_TRUE(stopped.done()) << text_of(stopped) << log();
  for (const char* node : {"cap01", "cap02"}) {
    const auto replied = nlohmann::json::parse(stopped.replies.at(node).detail);
    EXPECT_EQ(replied["cameras"][0]["written"].get<int64_t>(), kPulses) << node;
  }
  const auto recon = nlohmann::json::parse(stopped.replies.at("recon01").detail);
  EXPECT_EQ(recon["meshes"].get<int64_t>(),
            std::ssize(take::MeshFileReader(take().mesh()).pulses()));
}

}  // namespace
}  // namespace v3d
