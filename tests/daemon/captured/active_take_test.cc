// Takes of nodes without cameras, from arming to the ledger: of the trigger's node, on a simulated
// cable, and of a node that receives its pulse messages.
#include "daemon/captured/active_take.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <atomic>
#include <cerrno>
#include <thread>

#include "base/core/error.h"
#include "base/io/process.h"
#include "daemon/node/take_folder.h"
#include "support/child_process.h"
#include "support/fsync_hook.h"
#include "support/message_of.h"
#include "support/temporary_folder.h"
#include "take/ledger/verify.h"
#include "trigger/cable_server.h"
#include "wire/messages.h"

namespace v3d::captured {
namespace {

using test::becomes_true;
using test::within;
using testing::IsEmpty;

constexpr char kUrl[] = "udpm://239.255.76.67:7667?ttl=0";
constexpr char kTake[] = "kendo-07";
constexpr char kTriggerNode[] = "cap01";
constexpr int64_t kPulses = 4;

/// Number of pulses in pulses.lcmlog, which must be readable.
int64_t logged_pulses(const take::TakePaths& take) {
  std::vector<std::string> problems;
  const EdgeTimes edges = read_edge_times(take, problems);
  EXPECT_THAT(problems, testing::IsEmpty());
  return std::ssize(edges);
}

TEST(CheckOrder, refuses_a_take_that_could_not_be_read) {
  wire::CommandMessage order;
  order.verb = wire::CommandVerb::kArm;
  order.pulses = take::kMaxPulses;
  check_order(order);
  order.pulses += 1;
  EXPECT_EQ(test::message_of<InputError>([&] { check_order(order); }),
            "a take of 10,000,001 pulses is not possible; expected at most 10,000,000");
}

TEST(LengthStopReason, ends_an_unlimited_train_before_its_take_is_too_long_to_be_read) {
  const trigger::PulseTrain unlimited{.rate_hz = 25, .width = {}, .count = {}};
  EXPECT_EQ(length_stop_reason(unlimited, take::kMaxPulses - 251), "");
  EXPECT_THAT(length_stop_reason(unlimited, take::kMaxPulses - 250),
              testing::HasSubstr("10,000,000"));
  const trigger::PulseTrain limited{.rate_hz = 25, .width = {}, .count = take::kMaxPulses};
  EXPECT_EQ(length_stop_reason(limited, take::kMaxPulses), "") << "it ends by itself";
}

TEST(IdleTimeAfterTrain, is_never_shorter_than_a_pulse_may_be_sensed_late) {
  using std::chrono::milliseconds;
  EXPECT_EQ(idle_time_after_train(4), milliseconds(1000));
  EXPECT_EQ(idle_time_after_train(25), milliseconds(400));
  EXPECT_EQ(idle_time_after_train(120), capture::PulseTimes::kMaxSenseDelay);
}

class ActiveTakeTest : public testing::Test {
 protected:
  explicit ActiveTakeTest(std::string node)
      : node_(std::move(node)), studio_(studio()), trigger_(studio_, node_, bus_) {}

  Studio studio() const {
    Studio studio;
    studio.name = "dojo";
    studio.path = folder_ / "studio.toml";
    studio.nodes = {{kTriggerNode}, {"cap02"}};
    studio.trigger.node = kTriggerNode;
    studio.trigger.wire = cable_.path();
    studio.storage = {.takes = folder_ / "takes",
                      .background = folder_ / "background",
                      .calib = folder_ / "calib.toml"};
    test::write_text(studio.path, "# the studio\n");
    test::write_text(studio.storage.calib, "# the rig\n");
    std::filesystem::create_directories(studio.storage.background);
    std::filesystem::create_directories(studio.storage.takes);
    return studio;
  }
  ActiveTake::Context context() {
    return {{studio_, node_, bus_, cameras_, slots_, signer_},
            trigger_,
            [](const capture::PulseEdge&) {}};
  }
  static ActiveTake::Plan plan(wire::CommandVerb verb) {
    wire::CommandMessage order;
    order.verb = verb;
    order.take = kTake;
    return {.order = order,
            .train = {.rate_hz = 10, .width = std::chrono::milliseconds(1), .count = kPulses}};
  }
  /// The take as a restarted daemon finds it.
  TakeToResume recorded(int64_t commanded) {
    take::TakeLock lock = node::lock_take(paths(), node_);
    return {.order = plan(wire::CommandVerb::kArm).order,
            .commanded = commanded,
            .lock = std::move(lock),
            .recorded = RecordedTakeReader(paths(), {}).result()};
  }
  take::TakePaths paths() const { return node::take_paths(studio_, kTake); }
  bool exists(const std::filesystem::path& file) const { return std::filesystem::exists(file); }

  /// Stops the train and closes the take when it is drained.
  TakeResult drain(ActiveTake& take) {
    trigger_.stop();
    take.train_ended();
    EXPECT_TRUE(becomes_true([&] { return take.is_drained(); }, within(30)));
    return take.close();
  }

  const test::TemporaryFolder folder_;
  const trigger::CableServer cable_;
  bus::Bus bus_{kUrl};
  const std::string node_;
  const Studio studio_;
  capture::PulseTimes pulse_times_{std::chrono::milliseconds(100)};
  NodeTrigger trigger_;
  NodeCameras cameras_{studio_, node_, pulse_times_};
  PrioritySemaphore slots_{1};
  std::shared_ptr<const take::TakeSigner> signer_;
};

class TakeOfTheTriggersNode : public ActiveTakeTest {
 protected:
  TakeOfTheTriggersNode() : ActiveTakeTest(kTriggerNode) {}

  std::unique_ptr<ActiveTake> started(wire::CommandVerb verb) {
    trigger_.arm(plan(verb).train);
    return ActiveTake::begin(context(), plan(verb));
  }
  void run_train(ActiveTake& take) {
    take.start();
    trigger_.start();
    ASSERT_TRUE(becomes_true([&] { return trigger_.train_has_ended(kTake); }, within(30)));
  }
};

TEST_F(TakeOfTheTriggersNode, has_every_pulse_in_its_ledger_and_is_closed) {
  const auto take = started(wire::CommandVerb::kArm);
  ASSERT_TRUE(take->has_ledger());
  run_train(*take);
  const TakeResult result = drain(*take);
  EXPECT_EQ(result.ledger.take, kTake);
  EXPECT_EQ(result.ledger.commanded, kPulses);
  // Pulses that a busy host did not send in time are listed as not sensed.
  EXPECT_EQ(result.ledger.sensed.value() + std::ssize(result.ledger.unsensed), kPulses);
  EXPECT_GT(result.ledger.sensed.value(), 0);
  EXPECT_EQ(result.ledger.sensed.value() + result.ledger.extra, std::ssize(cable_.edges()));
  EXPECT_EQ(result.counts.commanded, kPulses);
  EXPECT_EQ(result.close_report.error, "");
  EXPECT_EQ(load_take_info(paths()).state, take::TakeState::kComplete);
  EXPECT_EQ(logged_pulses(paths()), result.ledger.sensed.value());
}

TEST_F(TakeOfTheTriggersNode, has_the_pulses_of_its_log_in_its_ledger_when_one_is_recorded_late) {
  const pid_t closing_thread = gettid();
  std::atomic<bool> is_late = false, is_closing = false;
  ActiveTake::Context late = context();
  late.on_edge = [&](const capture::PulseEdge&) {  // until close() waits for this thread
    if (is_late.exchange(true)) return;
    while (!is_closing || !thread_sleeps(closing_thread)) std::this_thread::yield();
  };
  trigger_.arm(plan(wire::CommandVerb::kArm).train);
  const auto take = ActiveTake::begin(late, plan(wire::CommandVerb::kArm));
  take->start();
  trigger_.start();
  EXPECT_TRUE(becomes_true([&] { return is_late.load(); }, within(30)));
  is_closing = true;
  const TakeResult result = take->close();
  EXPECT_GE(logged_pulses(paths()), 1);
  EXPECT_EQ(logged_pulses(paths()), result.ledger.sensed.value());
}

TEST_F(TakeOfTheTriggersNode, is_complete_and_reported_when_it_cannot_be_signed) {
  signer_ = std::make_shared<const take::TakeSigner>(
      take::TakeSigner{kTriggerNode, wire::SigningKey::make()});
  const auto take = started(wire::CommandVerb::kArm);
  run_train(*take);
  test::write_text(paths().studio(), "damaged");
  const TakeResult result = drain(*take);
  EXPECT_EQ(result.ledger.commanded, kPulses);
  EXPECT_EQ(result.close_report.error, "");
  EXPECT_THAT(result.close_report.signing_error,
              testing::AllOf(testing::HasSubstr("take kendo-07 is not signed: cannot sign"),
                             testing::HasSubstr("studio.toml")));
  EXPECT_EQ(load_take_info(paths()).state, take::TakeState::kComplete);
}

TEST_F(TakeOfTheTriggersNode,
       is_complete_and_reported_when_a_file_cannot_be_read_for_its_checksum) {
  const auto take = started(wire::CommandVerb::kArm);
  run_train(*take);
  std::filesystem::create_symlink("gone", paths().folder / "notes.txt");
  const TakeResult result = drain(*take);
  EXPECT_EQ(result.close_report.error, "");
  EXPECT_THAT(result.close_report.checksum_error,
              testing::AllOf(testing::HasSubstr("the ledger of kendo-07 lacks a checksum: cannot"),
                             testing::HasSubstr("notes.txt")));
  EXPECT_EQ(load_take_info(paths()).state, take::TakeState::kComplete);
}

TEST_F(TakeOfTheTriggersNode, stays_open_when_the_last_sync_of_its_pulses_fails) {
  const auto take = started(wire::CommandVerb::kArm);
  run_train(*take);
  test::FsyncHook hook;
  hook.fail_next(EIO);
  const TakeResult result = drain(*take);
  EXPECT_THAT(result.close_report.error,
              testing::StartsWith("kendo-07 stays open: cannot write the last pulses"));
  EXPECT_EQ(load_take_info(paths()).state, take::TakeState::kRecording);
}

TEST_F(TakeOfTheTriggersNode, is_moved_to_the_quarantine_without_a_pulse) {
  const auto take = started(wire::CommandVerb::kArm);
  EXPECT_TRUE(exists(paths().info()));
  const TakeResult result = take->close();
  EXPECT_EQ(result.ledger.commanded, 0);
  EXPECT_FALSE(exists(paths().folder)) << "its name is free again";
  const auto place = paths().folder.parent_path() / "quarantine" / paths().folder.filename();
  EXPECT_TRUE(exists(place / "take.toml"));
  EXPECT_THAT(result.close_report.quarantine_notice,
              testing::HasSubstr("moved to " + place.string()));
}

TEST_F(TakeOfTheTriggersNode, stays_without_a_pulse_when_its_folder_has_a_frame) {
  const auto take = started(wire::CommandVerb::kArm);
  const auto log = paths().folder / "cam77.lcmlog";  // which the ledger does not name
  test::write_text(log, "x");
  const TakeResult result = take->close();
  EXPECT_EQ(result.ledger.commanded, 0);
  EXPECT_EQ(result.close_report.error, "");
  EXPECT_EQ(result.close_report.quarantine_notice, "");
  EXPECT_TRUE(exists(paths().info()));
  EXPECT_TRUE(exists(log));
}

TEST_F(TakeOfTheTriggersNode, records_nothing_when_it_is_a_check) {
  const auto take = started(wire::CommandVerb::kCheck);
  EXPECT_TRUE(take->has_ledger());
  EXPECT_EQ(take->recording(), nullptr);
  run_train(*take);
  const TakeResult result = drain(*take);
  EXPECT_EQ(result.ledger.commanded, kPulses);
  EXPECT_THAT(result.checked, IsEmpty());
  EXPECT_FALSE(exists(paths().folder));
}

TEST_F(TakeOfTheTriggersNode, has_no_ledger_when_the_background_is_learnt) {
  const auto take = started(wire::CommandVerb::kBackground);
  EXPECT_FALSE(take->has_ledger());
  run_train(*take);
  take->train_ended();
  EXPECT_TRUE(becomes_true([&] { return take->background_result().has_value(); }, within(30)));
  EXPECT_FALSE(exists(paths().folder));
}

class TakeOfAnotherNode : public ActiveTakeTest {
 protected:
  TakeOfAnotherNode() : ActiveTakeTest("cap02") {}

  void publish_pulse(int64_t pulse) {
    wire::PulseMessage message;
    message.take = kTake;
    message.pulse = pulse;
    bus_.publish_authenticated(wire::kPulseChannel, encode(message));
  }
  void publish_commanded(int64_t pulses, wire::NodeState state = wire::NodeState::kRecording) {
    wire::HealthMessage health;
    health.sent = Realtime::now();
    health.seq = health_seq_++;
    health.node = kTriggerNode;
    health.state = state;
    health.take = kTake;
    health.values["pulses_commanded"] = static_cast<double>(pulses);
    bus_.publish(wire::health_channel(kTriggerNode), encode(health));
  }
  bool receives(const ActiveTake& take, int64_t commanded, int64_t sensed) {
    return becomes_true(
        [&] {
          trigger_.poll(kTake);
          const TakeCounts counts = take.counts();
          return counts.commanded == commanded && counts.sensed == sensed;
        },
        within(30));
  }

  int64_t health_seq_ = 0;
};

TEST_F(TakeOfAnotherNode, states_the_sensed_pulses_when_it_received_every_message) {
  const auto take = ActiveTake::begin(context(), plan(wire::CommandVerb::kArm));
  trigger_.start();
  for (int64_t pulse = 0; pulse < 3; ++pulse) publish_pulse(pulse);
  ASSERT_TRUE(receives(*take, 3, 3));
  const TakeResult result = drain(*take);
  EXPECT_EQ(result.ledger.commanded, 3);
  EXPECT_EQ(result.ledger.sensed, 3);
}

TEST_F(TakeOfAnotherNode, is_empty_when_it_is_aborted_before_its_start_after_another_take) {
  {
    const auto take = ActiveTake::begin(context(), plan(wire::CommandVerb::kArm));
    trigger_.start();
    publish_commanded(kPulses);
    ASSERT_TRUE(receives(*take, kPulses, 0));
    drain(*take);
  }
  std::filesystem::remove_all(paths().folder);
  trigger_.arm(plan(wire::CommandVerb::kArm).train);
  const auto take = ActiveTake::begin(context(), plan(wire::CommandVerb::kArm));
  EXPECT_EQ(take->counts().commanded, 0);
  const TakeResult result = take->close();
  EXPECT_EQ(result.ledger.commanded, 0);
  EXPECT_THAT(result.close_report.quarantine_notice, testing::HasSubstr("moved to"));
  EXPECT_FALSE(exists(paths().folder)) << "its name is free again";
}

TEST_F(TakeOfAnotherNode, omits_the_sensed_pulses_when_a_message_was_lost) {
  const auto take = ActiveTake::begin(context(), plan(wire::CommandVerb::kArm));
  trigger_.start();
  for (const int64_t pulse : {0, 2}) publish_pulse(pulse);
  publish_commanded(kPulses);
  ASSERT_TRUE(receives(*take, kPulses, 2));
  const TakeResult result = drain(*take);
  EXPECT_EQ(result.ledger.commanded, kPulses);
  EXPECT_FALSE(result.ledger.sensed.has_value());
}

TEST_F(TakeOfAnotherNode, has_a_minimum_of_pulses_when_it_is_closed_before_the_train_ends) {
  const auto take = ActiveTake::begin(context(), plan(wire::CommandVerb::kArm));
  trigger_.start();
  publish_commanded(kPulses - 1);
  ASSERT_TRUE(receives(*take, kPulses - 1, 0));
  EXPECT_TRUE(drain(*take).ledger.commanded_is_minimum);
}

TEST_F(TakeOfAnotherNode, has_all_pulses_when_the_triggers_node_has_stopped_or_none_can_follow) {
  for (const auto& [pulses, state] : {std::pair(kPulses - 1, wire::NodeState::kDraining),
                                      std::pair(kPulses, wire::NodeState::kRecording)}) {
    std::filesystem::remove_all(paths().folder);
    const auto take = ActiveTake::begin(context(), plan(wire::CommandVerb::kArm));
    trigger_.start();
    publish_commanded(pulses);
    publish_commanded(pulses, state);
    ASSERT_TRUE(receives(*take, pulses, 0));
    if (state == wire::NodeState::kDraining) {
      ASSERT_TRUE(becomes_true([&] { return trigger_.train_has_ended(kTake); }, within(30)));
    }
    EXPECT_FALSE(drain(*take).ledger.commanded_is_minimum) << pulses;
  }
}

TEST_F(TakeOfAnotherNode, waits_for_a_late_report_of_the_end_of_the_train) {
  constexpr Duration kLate = std::chrono::milliseconds(1100);     // idle since 100 ms
  constexpr Duration kTooLate = std::chrono::milliseconds(1400);  // this machine is too busy
  bool is_minimum = true;
  for (int round = 0; round < 10; ++round) {
    std::filesystem::remove_all(paths().folder);
    const auto take = ActiveTake::begin(context(), plan(wire::CommandVerb::kArm));
    trigger_.start();
    publish_commanded(kPulses - 1);
    ASSERT_TRUE(receives(*take, kPulses - 1, 0));
    const MonotonicInstant ended = Monotonic::now();
    take->train_ended();
    ASSERT_TRUE(becomes_true(
        [&] {
          trigger_.poll(kTake);
          if (take->is_drained()) return true;
          const bool is_late = Monotonic::now() - ended > kLate;
          if (is_late) publish_commanded(kPulses - 1, wire::NodeState::kDraining);
          return false;
        },
        within(30)));
    is_minimum = take->close().ledger.commanded_is_minimum;
    if (!is_minimum || Monotonic::now() - ended < kTooLate) break;
  }
  EXPECT_FALSE(is_minimum);
}

TEST_F(TakeOfAnotherNode, is_resumed_with_the_pulses_of_its_log) {
  {
    const auto take = ActiveTake::begin(context(), plan(wire::CommandVerb::kArm));
    for (int64_t pulse = 0; pulse < 2; ++pulse) publish_pulse(pulse);
    ASSERT_TRUE(receives(*take, 2, 2));
  }
  EXPECT_EQ(load_take_info(paths()).state, take::TakeState::kRecording) << "as a crash leaves it";
  recover_take(paths());
  const auto take = ActiveTake::resume(context(), plan(wire::CommandVerb::kArm), recorded(5));
  EXPECT_EQ(take->counts().sensed, 2);
  publish_pulse(6);
  ASSERT_TRUE(receives(*take, 7, 3));
  const TakeResult result = drain(*take);
  EXPECT_EQ(result.ledger.commanded, 7);
  EXPECT_EQ(result.close_report.error, "");
  EXPECT_EQ(load_take_info(paths()).state, take::TakeState::kComplete);
  EXPECT_EQ(logged_pulses(paths()), 3);
}

/// The order and the take of before the restart are on the disk.
class TakeToRejoin : public TakeOfAnotherNode {
 protected:
  TakeToRejoin() {
    ActiveTake::Plan armed = plan(wire::CommandVerb::kArm);
    armed.order.sender = "ada@pc";
    const auto take = ActiveTake::begin(context(), armed);
    publish_pulse(0);
    EXPECT_TRUE(receives(*take, 1, 1));
  }
  bool is_locked() const { return !take_lock_holder(paths()).value().empty(); }

  RecoveredTakeSigner signing_{studio_, node_};
  bus::EventSender events_{bus_, node_};
};

TEST_F(TakeToRejoin, is_returned_with_its_lock_and_its_latest_number_of_pulses) {
  node::PersistedCommands commands(studio_, node_);
  TakeRejoin rejoin(studio_, node_, commands, signing_, events_);
  std::vector<TakeToResume> resumed;
  const auto poll = [&] {
    rejoin.cancel_unless_polled();
    publish_commanded(7);
    if (auto found = rejoin.poll(*trigger_.monitor())) resumed.push_back(*std::move(found));
    return !resumed.empty();
  };
  ASSERT_TRUE(becomes_true(poll, within(30)));
  EXPECT_TRUE(is_locked());
  EXPECT_EQ(resumed[0].order.take, kTake);
  EXPECT_EQ(resumed[0].commanded, 7);
  EXPECT_EQ(resumed[0].recorded.edges.size(), 1U);
  resumed.clear();
  EXPECT_FALSE(is_locked());
}

TEST_F(TakeToRejoin, is_unlocked_when_the_node_may_not_rejoin_any_more) {
  node::PersistedCommands commands(studio_, node_);
  TakeRejoin rejoin(studio_, node_, commands, signing_, events_);
  std::vector<TakeToResume> resumed;
  const auto poll = [&] {
    publish_commanded(7);
    if (auto found = rejoin.poll(*trigger_.monitor())) resumed.push_back(*std::move(found));
    return is_locked();
  };
  ASSERT_TRUE(becomes_true(poll, within(30)));
  resumed.clear();
  rejoin.cancel_unless_polled();
  rejoin.cancel_unless_polled();
  EXPECT_FALSE(is_locked());
}

TEST_F(TakeOfAnotherNode, stays_open_when_its_recovery_has_failed) {
  {
    const auto take = ActiveTake::begin(context(), plan(wire::CommandVerb::kArm));
    publish_pulse(0);
    ASSERT_TRUE(receives(*take, 1, 1));
  }
  {
    test::FsyncHook hook;
    hook.fail_next(ENOSPC);
    const auto recovered = node::recover_open_takes(studio_, node_, {});
    ASSERT_EQ(std::ssize(recovered), 1);
    ASSERT_THAT(recovered[0].line, testing::HasSubstr("No space left on device"));
  }
  const auto take = ActiveTake::resume(context(), plan(wire::CommandVerb::kArm), recorded(1));
  publish_pulse(1);
  ASSERT_TRUE(receives(*take, 2, 2));
  EXPECT_THAT(
      drain(*take).close_report.error,
      testing::HasSubstr("kendo-07 stays open: cannot count what it had before the restart: "
                         "its recovery has failed"));
  EXPECT_EQ(load_take_info(paths()).state, take::TakeState::kRecording);
}

}  // namespace
}  // namespace v3d::captured
