// A take from its beginning to its account, at nodes without cameras: the trigger's, on a simulated
// cable, and one that hears of its pulses.
#include "daemon/captured/active_take.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "daemon/node/take_folder.h"
#include "support/child_process.h"
#include "support/temporary_folder.h"
#include "trigger/cable_server.h"
#include "wire/channels.h"

namespace v3d {
namespace {

using test::becomes_true;
using test::within;
using testing::IsEmpty;

constexpr char kUrl[] = "udpm://239.255.76.67:7667?ttl=0";
constexpr char kTake[] = "kendo-07";
constexpr char kTriggerNode[] = "cap01";
constexpr int64_t kPulses = 4;

class TakeUnderWayTest : public testing::Test {
 protected:
  explicit TakeUnderWayTest(std::string node)
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
  ActiveTake::Node here() {
    return {{studio_, node_, bus_, cameras_, places_}, trigger_, [](const PulseEdge&) {}};
  }
  static ActiveTake::Plan plan(CommandVerb verb) {
    CommandMessage order;
    order.verb = verb;
    order.take = kTake;
    return {.order = order,
            .train = {.rate_hz = 10, .width = std::chrono::milliseconds(1), .count = kPulses}};
  }
  TakePaths paths() const { return take_paths(studio_, kTake); }
  bool exists(const std::filesystem::path& file) const { return std::filesystem::exists(file); }

  /// Until everything is accounted for.
  TakeAccount drain(ActiveTake& take) {
    trigger_.stop();
    take.train_ended();
    EXPECT_TRUE(becomes_true([&] { return take.is_accounted_for(); }, within(30)));
    return take.close();
  }

  const test::TemporaryFolder folder_;
  const CableServer cable_;
  Bus bus_{kUrl};
  const std::string node_;
  const Studio studio_;
  PulseTimes pulse_times_{std::chrono::milliseconds(100)};
  NodeTrigger trigger_;
  NodeCameras cameras_{studio_, node_, pulse_times_};
  PrioritySemaphore places_{1};
};

class TakeOfTheTriggersNode : public TakeUnderWayTest {
 protected:
  TakeOfTheTriggersNode() : TakeUnderWayTest(kTriggerNode) {}

  std::unique_ptr<ActiveTake> begun(CommandVerb verb) {
    trigger_.arm(plan(verb).train);
    return ActiveTake::begin(here(), plan(verb));
  }
  void play_train(ActiveTake& take) {
    take.start();
    trigger_.start();
    ASSERT_TRUE(becomes_true([&] { return trigger_.train_is_over(kTake); }, within(30)));
  }
};

TEST_F(TakeOfTheTriggersNode, accounts_for_every_pulse_and_is_closed) {
  const auto take = begun(CommandVerb::kArm);
  ASSERT_TRUE(take->is_counted());
  play_train(*take);
  const TakeAccount account = drain(*take);
  EXPECT_EQ(account.ledger.take, kTake);
  EXPECT_EQ(account.ledger.commanded, kPulses);
  // What a busy host did not send in time is named.
  EXPECT_EQ(account.ledger.sensed.value() + std::ssize(account.ledger.unsensed), kPulses);
  EXPECT_EQ(account.counts.commanded, kPulses);
  EXPECT_EQ(account.closing.unkept, "");
  EXPECT_EQ(load_take_info(paths()).state, TakeState::kComplete);
  EXPECT_EQ(std::ssize(edge_times(paths())), account.ledger.sensed.value());
}

TEST_F(TakeOfTheTriggersNode, is_moved_to_the_quarantine_when_it_never_saw_a_pulse) {
  const auto take = begun(CommandVerb::kArm);
  EXPECT_TRUE(exists(paths().info()));
  const TakeAccount account = take->close();
  EXPECT_EQ(account.ledger.commanded, 0);
  EXPECT_FALSE(exists(paths().folder)) << "its name is free again";
  const auto place = paths().folder.parent_path() / "quarantine" / paths().folder.filename();
  EXPECT_TRUE(exists(place / "take.toml"));
  EXPECT_THAT(account.closing.notice, testing::HasSubstr("moved to " + place.string()));
}

TEST_F(TakeOfTheTriggersNode, records_nothing_when_it_is_a_check) {
  const auto take = begun(CommandVerb::kCheck);
  EXPECT_TRUE(take->is_counted());
  EXPECT_EQ(take->recording(), nullptr);
  play_train(*take);
  const TakeAccount account = drain(*take);
  EXPECT_EQ(account.ledger.commanded, kPulses);
  EXPECT_THAT(account.checked, IsEmpty());
  EXPECT_FALSE(exists(paths().folder));
}

TEST_F(TakeOfTheTriggersNode, has_no_account_when_the_background_is_learnt) {
  const auto take = begun(CommandVerb::kBackground);
  EXPECT_FALSE(take->is_counted());
  play_train(*take);
  take->train_ended();
  EXPECT_TRUE(becomes_true([&] { return take->learnt().has_value(); }, within(30)));
  EXPECT_FALSE(exists(paths().folder));
}

class TakeOfAnotherNode : public TakeUnderWayTest {
 protected:
  TakeOfAnotherNode() : TakeUnderWayTest("cap02") {}

  void say_pulse(int64_t pulse) {
    PulseMessage message;
    message.take = kTake;
    message.pulse = pulse;
    bus_.publish_sealed(kPulseChannel, encode(message));
  }
  void say_commanded(int64_t pulses) {
    HealthMessage health;
    health.sent = Realtime::now();
    health.node = kTriggerNode;
    health.state = NodeState::kRecording;
    health.take = kTake;
    health.values["pulses_commanded"] = static_cast<double>(pulses);
    bus_.publish(health_channel(kTriggerNode), encode(health));
  }
  bool hears(const ActiveTake& take, int64_t commanded, int64_t sensed) {
    return becomes_true(
        [&] {
          trigger_.listen(kTake);
          const TakeCounts counts = take.counts();
          return counts.commanded == commanded && counts.sensed == sensed;
        },
        within(30));
  }
};

TEST_F(TakeOfAnotherNode, tells_what_was_sensed_where_it_heard_of_every_pulse) {
  const auto take = ActiveTake::begin(here(), plan(CommandVerb::kArm));
  trigger_.start();
  for (int64_t pulse = 0; pulse < 3; ++pulse) say_pulse(pulse);
  ASSERT_TRUE(hears(*take, 3, 3));
  const TakeAccount account = drain(*take);
  EXPECT_EQ(account.ledger.commanded, 3);
  EXPECT_EQ(account.ledger.sensed, 3);
}

TEST_F(TakeOfAnotherNode, does_not_tell_what_was_sensed_where_it_missed_a_pulse) {
  const auto take = ActiveTake::begin(here(), plan(CommandVerb::kArm));
  trigger_.start();
  for (const int64_t pulse : {0, 2}) say_pulse(pulse);
  say_commanded(kPulses);
  ASSERT_TRUE(hears(*take, kPulses, 2));
  const TakeAccount account = drain(*take);
  EXPECT_EQ(account.ledger.commanded, kPulses);
  EXPECT_FALSE(account.ledger.sensed.has_value());
}

TEST_F(TakeOfAnotherNode, goes_on_with_the_pulses_that_its_log_has) {
  {
    const auto take = ActiveTake::begin(here(), plan(CommandVerb::kArm));
    for (int64_t pulse = 0; pulse < 2; ++pulse) say_pulse(pulse);
    ASSERT_TRUE(hears(*take, 2, 2));
  }
  EXPECT_EQ(load_take_info(paths()).state, TakeState::kRecording) << "as a crash leaves it";
  const auto take = ActiveTake::go_on(here(), plan(CommandVerb::kArm), 5);
  EXPECT_EQ(take->counts().sensed, 2);
  say_pulse(6);
  ASSERT_TRUE(hears(*take, 7, 3));
  const TakeAccount account = drain(*take);
  EXPECT_EQ(account.ledger.commanded, 7);
  EXPECT_EQ(std::ssize(edge_times(paths())), 3);
}

}  // namespace
}  // namespace v3d
