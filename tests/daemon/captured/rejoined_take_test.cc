// The return of a node to a running take after a restart, with a camera that cannot be opened any
// more.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <future>
#include <map>

#include "base/core/error.h"
#include "base/io/file.h"
#include "daemon/captured/active_take.h"
#include "daemon/captured/capture_node.h"
#include "daemon/node/take_folder.h"
#include "support/begun_take.h"
#include "support/child_process.h"
#include "support/lock_holder.h"
#include "support/sounding_take.h"
#include "support/studio_text.h"
#include "support/temporary_folder.h"
#include "take/ledger/take_signature.h"
#include "take/ledger/verify.h"

namespace v3d::captured {
namespace {

namespace fs = std::filesystem;
using test::becomes_true;
using test::within;
using testing::HasSubstr;
using testing::IsEmpty;

constexpr char kUrl[] = "udpm://239.255.76.67:7667?ttl=0";
constexpr char kTake[] = "kendo-07";
constexpr char kTriggerNode[] = "cap01";
constexpr char kNode[] = "cap02";
constexpr char kCamera[] = "cam03";
constexpr int64_t kFrames = 20;
constexpr ImageSize kSize{16, 8};

/// The take is recovered, and the trigger's node still records it.
class RejoinedTake : public testing::Test {
 protected:
  RejoinedTake() {
    take::TakeInfo info = test::begun_take({kCamera});
    info.rate_hz = 10;
    node::create_take(studio_, info);
    wire::CommandMessage order = plan().order;
    order.sender = "ada@pc";
    node::persist_command(studio_, kNode, order);
    record();
    recover_take(paths_);
  }

  Studio studio() const {
    Studio studio;
    studio.name = "dojo";
    studio.path = folder_ / "studio.toml";
    studio.nodes = {{kTriggerNode}, {kNode}};
    studio.trigger.node = kTriggerNode;
    studio.trigger.wire = folder_ / "cable";
    StudioCamera& camera = studio.cameras.emplace_back();
    camera.name = kCamera;
    camera.node = kNode;
    camera.kind = CameraKind::kV4l2;
    camera.address = folder_ / "unplugged";
    studio.storage = {.takes = folder_ / "takes",
                      .background = folder_ / "background",
                      .calib = folder_ / "calib.toml"};
    test::write_text(studio.path, test::studio_text({{kTriggerNode, {}}, {kNode, {kCamera}}}));
    test::write_text(studio.storage.calib, "# the rig\n");
    fs::create_directories(studio.storage.takes);
    const std::vector<float> mean(kSize.width * kSize.height, 100), spread(mean.size(), 1);
    segmentation::save_background(
        studio.storage.background, kCamera,
        {.size = kSize, .format = PixelFormat::kMono8, .mean = mean, .spread = spread});
    return studio;
  }
  void record() const {
    take::EventLogWriter pulses(paths_.pulses()), frames(paths_.frames(kCamera));
    for (int64_t n = 0; n < kFrames; ++n) {
      wire::PulseMessage pulse;
      pulse.take = kTake;
      pulse.pulse = n;
      EXPECT_TRUE(pulses.write(pulse));
      wire::FrameMessage message;
      message.take = kTake;
      message.frame.camera = kCamera;
      message.frame.label.pulse = n;
      message.frame.label.camera_counter = static_cast<uint64_t>(n);
      message.frame.image = Image(kSize, PixelFormat::kMono8);
      EXPECT_TRUE(frames.write(message));
    }
  }
  static ActiveTake::Plan plan() {
    wire::CommandMessage order;
    order.verb = wire::CommandVerb::kArm;
    order.take = kTake;
    return {.order = order,
            .train = {.rate_hz = 10, .width = std::chrono::milliseconds(1), .count = {}}};
  }
  TakeToResume recorded() const {
    take::TakeLock lock = node::lock_take(paths_, kNode);
    return {.order = plan().order,
            .commanded = kFrames,
            .lock = std::move(lock),
            .recorded = RecordedTakeReader(paths_, {kCamera}).result()};
  }
  void publish_health(wire::NodeState state, const std::string& take) {
    wire::HealthMessage health;
    health.sent = Realtime::now();
    health.seq = health_seq_++;
    health.node = kTriggerNode;
    health.state = state;
    health.take = take;
    health.values["pulses_commanded"] = kFrames + 1;
    bus_.publish(wire::health_channel(kTriggerNode), encode(health));
  }
  void publish_running() { publish_health(wire::NodeState::kRecording, kTake); }

  /// The contents of the files of the take that are not hidden, by name.
  std::map<std::string, std::string> files() const {
    std::map<std::string, std::string> files;
    for (const fs::directory_entry& entry : fs::directory_iterator(paths_.folder)) {
      const std::string name = entry.path().filename();
      if (!name.starts_with(".") && entry.is_regular_file()) files[name] = read_file(entry.path());
    }
    return files;
  }

  const test::TemporaryFolder folder_;
  bus::Bus bus_{kUrl};
  bus::Subscription<wire::EventMessage> events_{bus_, wire::kEventChannel, 64};
  const Studio studio_ = studio();
  const take::TakePaths paths_ = node::take_paths(studio_, kTake);
  int64_t health_seq_ = 0;
};

/// ActiveTake and its parts.
class TakeOfAReturnedCamera : public RejoinedTake {
 protected:
  ActiveTake::Context context() {
    return {{studio_, node_, bus_, cameras_, slots_, signer_},
            trigger_,
            [](const capture::PulseEdge&) {}};
  }
  static void sign(const take::TakePaths& take) {
    ASSERT_TRUE(
        sign_whole_take(take, {kNode, wire::SigningKey::make()}, take::SigningOccasion::kRecovery));
  }
  int64_t frames_of_the_camera() const { return (*cameras_.begin())->status().frames; }

  const std::string node_ = kNode;
  capture::PulseTimes pulse_times_{std::chrono::milliseconds(100)};
  NodeTrigger trigger_{studio_, kNode, bus_};
  NodeCameras cameras_{studio_, kNode, pulse_times_};
  PrioritySemaphore slots_{1};
  std::shared_ptr<const take::TakeSigner> signer_;
};

TEST_F(TakeOfAReturnedCamera, has_the_frames_of_before_in_its_ledger) {
  const auto take = ActiveTake::resume(context(), plan(), recorded());
  EXPECT_EQ(frames_of_the_camera(), kFrames);
  EXPECT_EQ(load_take_info(paths_).state, take::TakeState::kRecording);
  const TakeResult result = take->close();
  EXPECT_EQ(result.close_report.error, "");
  ASSERT_EQ(result.ledger.cameras.size(), 1U);
  EXPECT_EQ(result.ledger.cameras[0].written, kFrames);
  EXPECT_EQ(result.ledger.cameras[0].received, kFrames);
  EXPECT_EQ(load_take_info(paths_).state, take::TakeState::kComplete);
}

TEST_F(TakeOfAReturnedCamera, is_joined_by_the_camera_after_everything_else) {
  const NodeTake::Plan recording{.order = plan().order, .disk = {}};
  const auto take = NodeTake::resume(context(), recording, recorded());
  EXPECT_EQ(take->camera_count(), 1U);
  EXPECT_EQ(frames_of_the_camera(), 0) << "it holds frames until a pulse is reported";
  take->rejoin(true);
  EXPECT_EQ(frames_of_the_camera(), kFrames);
}

/// After a crash of the continued take, a signature of before would differ from the ledger, and the
/// take would not be signed again.
TEST_F(TakeOfAReturnedCamera, has_no_signature_of_before_when_it_is_recorded_again) {
  sign(paths_);
  const auto take = ActiveTake::resume(context(), plan(), recorded());
  EXPECT_FALSE(fs::exists(signature_path(paths_, kNode)));
}

TEST_F(TakeOfAReturnedCamera, is_as_it_was_when_its_pulses_cannot_be_received) {
  for (const int last : {take::kMaxSegments - 1, take::kMaxSegments}) {
    test::write_text(take::segment_path(paths_.pulses(), last), "");  // no segment can follow
  }
  sign(paths_);
  const auto before = files();
  ASSERT_TRUE(before.contains("signature.cap02.toml"));
  EXPECT_THROW(ActiveTake::resume(context(), plan(), recorded()), InputError);
  EXPECT_EQ(files(), before) << "a recount would read the logs for minutes";
  EXPECT_EQ(frames_of_the_camera(), 0);
  EXPECT_EQ(take_lock_holder(paths_).value(), "");
}

TEST_F(TakeOfAReturnedCamera, stays_open_when_something_was_added_before_it_is_given_up) {
  const NodeTake::Plan recording{.order = plan().order, .disk = {}};
  auto take = NodeTake::resume(context(), recording, recorded());
  test::write_text(take::segment_path(paths_.pulses(), 1), "a pulse");
  take.reset();
  EXPECT_EQ(load_take_info(paths_).state, take::TakeState::kRecording);
  EXPECT_EQ(read_file(take::segment_path(paths_.pulses(), 1)), "a pulse");
}

TEST_F(TakeOfAReturnedCamera, has_the_sound_of_before_as_the_ledger_had_it) {
  take::Ledger ledger = take::load_ledger(paths_.ledger());
  const auto written = test::write_sound(paths_, {}, 48'000, 2, [](int64_t, int) { return 0.0; });
  fs::rename(paths_.sound() / "cap01.wav", paths_.sound() / "cap02.wav");
  ledger.sounds = {written};
  ledger.sounds[0].file = "sound/cap02.wav";
  ledger.sounds[0].node = kNode;
  ledger.sounds[0].xruns = 7;  // of which the file tells nothing
  ASSERT_TRUE(save_ledger(paths_.ledger(), ledger));
  NodeSound sound({.node = kNode, .device = "simulated:", .timecode_rate = ""}, folder_ / "cable");
  ActiveTake::Context with_sound = context();
  with_sound.sound = &sound;
  const auto take = ActiveTake::resume(with_sound, plan(), recorded());
  const std::vector<take::SoundLedger> sounds = take->close().ledger.sounds;
  ASSERT_GE(sounds.size(), 1U);
  EXPECT_EQ(sounds[0], ledger.sounds[0]);
}

TEST_F(TakeOfAReturnedCamera, has_its_node_without_sound_when_the_device_has_delivered_nothing) {
  NodeSound sound({.node = kNode, .device = "hw:CARD=NoSuchCard", .timecode_rate = ""}, {});
  ActiveTake::Context with_sound = context();
  with_sound.sound = &sound;
  const take::Ledger ledger = ActiveTake::resume(with_sound, plan(), recorded())->close().ledger;
  ASSERT_GT(ledger.commanded, 0);
  EXPECT_EQ(ledger.nodes_without_sound, std::vector<std::string>{kNode});
  EXPECT_TRUE(take::load_ledger(paths_.ledger()).sounds.empty());
}

TEST_F(TakeOfAReturnedCamera, has_no_sound_to_miss_on_a_node_without_a_device) {
  const take::Ledger ledger = ActiveTake::resume(context(), plan(), recorded())->close().ledger;
  EXPECT_TRUE(ledger.nodes_without_sound.empty());
}

TEST_F(TakeOfAReturnedCamera, is_unlocked_when_it_ends_while_its_logs_are_read) {
  std::promise<void> end_of_time;
  const std::future<void> never = end_of_time.get_future();
  node::PersistedCommands commands(studio_, kNode);
  RecoveredTakeSigner signing(studio_, kNode);
  bus::EventSender sender(bus_, kNode);
  const auto disk_is_slow = [&] { never.wait_for(std::chrono::seconds(1)); };
  TakeRejoin rejoin(studio_, node_, commands, signing, sender, disk_is_slow);
  const auto is_locked = [&] { return !take_lock_holder(paths_).value().empty(); };
  const auto polled = [&](wire::NodeState state, const std::string& take) {
    rejoin.cancel_unless_polled();
    publish_health(state, take);
    EXPECT_FALSE(rejoin.poll(*trigger_.monitor()));
    return is_locked();
  };
  ASSERT_TRUE(becomes_true([&] { return polled(wire::NodeState::kRecording, kTake); }, within(30)));
  EXPECT_THAT(rejoin.text(), HasSubstr("does not record kendo-07 yet: reads pulses.lcmlog"));
  EXPECT_TRUE(becomes_true([&] { return !polled(wire::NodeState::kIdle, ""); }, within(30)));
  EXPECT_EQ(rejoin.text(), "");
}

/// The node of the camera.
class NodeThatReturns : public RejoinedTake {
 protected:
  /// Calls the node as the main loop does, until rejoin() returns or throws.
  std::string error_of_rejoin() {
    std::string error = "none";
    EXPECT_TRUE(becomes_true(
        [&] {
          publish_running();
          return has_tried(error);
        },
        within(60)));
    return error;
  }
  bool has_tried(std::string& error) {
    node_.poll(control::Phase::kIdle);
    try {
      return node_.rejoin().has_value();
    } catch (const InputError& failed) {
      error = failed.what();
      return true;
    }
  }
  std::string health_text() {
    wire::HealthMessage health;
    node_.report_health(health);
    return health.text;
  }
  /// The next event about takes.
  wire::EventMessage event() {
    for (;;) {
      const auto event = events_.wait(within(30));
      if (!event || event->subject == "take") return event.value_or(wire::EventMessage{});
    }
  }

  CaptureNode node_{studio_, kNode, bus_};
};

TEST_F(NodeThatReturns, reports_that_it_does_not_record_while_it_reads_and_when_it_does) {
  EXPECT_EQ(error_of_rejoin(), "none");
  const wire::EventMessage reads = event(), records = event();
  EXPECT_EQ(reads.severity, wire::Severity::kWarning);
  EXPECT_THAT(reads.text, HasSubstr("cap02 restarted and does not record kendo-07 yet"));
  EXPECT_THAT(records.text, HasSubstr("cap02 restarted and records kendo-07 again, from pulse 21"));
  EXPECT_THAT(health_text(), testing::Not(HasSubstr("does not record")));
  node_.disarm();
}

TEST_F(NodeThatReturns, reports_why_it_does_not_record_until_the_take_has_ended) {
  test::LockHolder other(paths_, kNode);
  EXPECT_THAT(error_of_rejoin(), HasSubstr("has locked it"));
  const wire::EventMessage alarm = event();
  EXPECT_EQ(alarm.severity, wire::Severity::kAlarm);
  EXPECT_THAT(alarm.text, testing::AllOf(HasSubstr("cap02 does not record kendo-07: "),
                                         HasSubstr("has locked it"), HasSubstr("tries again")));
  EXPECT_THAT(health_text(), HasSubstr("does not record kendo-07: "));
  std::string error;
  publish_running();
  has_tried(error);
  EXPECT_THAT(health_text(), HasSubstr("does not record kendo-07: "));
  EXPECT_TRUE(becomes_true(
      [&] {
        publish_health(wire::NodeState::kIdle, "");
        has_tried(error);
        return health_text().find("does not record") == std::string::npos;
      },
      within(30)));
}

TEST_F(NodeThatReturns, changes_nothing_in_a_take_whose_plates_are_missing) {
  fs::remove(paths_.background() / "cam03.mean.png");
  const auto before = files();
  EXPECT_THAT(error_of_rejoin(), HasSubstr("cam03.mean.png"));
  EXPECT_EQ(files(), before) << "a recount would read the logs for minutes";
  EXPECT_EQ(event().severity, wire::Severity::kWarning) << "it reads";
  EXPECT_EQ(event().severity, wire::Severity::kAlarm);
}

TEST_F(NodeThatReturns, sends_an_alarm_about_a_take_that_the_recovery_left_open) {
  node_.report_open_take("take kendo-06 stays open: Input/output error");
  health_text();
  const wire::EventMessage alarm = event();
  EXPECT_EQ(alarm.severity, wire::Severity::kAlarm);
  EXPECT_THAT(alarm.text, HasSubstr("kendo-06 stays open: Input/output error"));
}

}  // namespace
}  // namespace v3d::captured
