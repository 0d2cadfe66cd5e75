// A capture node with the trigger and without cameras: its pulses trigger cameras of other nodes.
#include "daemon/captured/capture_node.h"

#include <gtest/gtest.h>

#include "support/child_process.h"
#include "support/temporary_folder.h"
#include "trigger/cable_server.h"

namespace v3d {
namespace {

constexpr char kUrl[] = "udpm://239.255.76.67:7667?ttl=0";
constexpr int64_t kPulses = 4;

class TriggerOnlyNode : public testing::Test {
 protected:
  Studio studio() const {
    Studio studio;
    studio.nodes = {{"cap01"}};
    studio.trigger.node = "cap01";
    studio.trigger.wire = cable_.path();
    studio.trigger.rate_hz = 5;
    studio.storage.background = folder_ / "background";
    return studio;
  }
  static CommandMessage order(CommandVerb verb) {
    CommandMessage order;
    order.verb = verb;
    order.take = name(verb);
    order.pulses = kPulses;
    return order;
  }
  /// The report of the node in this phase.
  NodeReport report(Phase phase) {
    std::optional<NodeReport> report;
    EXPECT_TRUE(test::becomes_true(
        [&] {
          report = node_.poll(phase);
          return report.has_value();
        },
        test::within(30)));
    return report.value_or(NodeReport{});
  }
  double pulses_commanded() {
    HealthMessage health;
    node_.report_health(health);
    return health.values.at("pulses_commanded");
  }

  const test::TemporaryFolder folder_;
  CableServer cable_;
  const Studio studio_ = studio();
  Bus bus_{kUrl};
  CaptureNode node_{studio_, "cap01", bus_};
};

TEST_F(TriggerOnlyNode, has_learnt_the_background_when_the_pulses_have_ended) {
  node_.learn(order(CommandVerb::kBackground));
  ASSERT_EQ(report(Phase::kArming).event, Input::kReady);
  node_.start();
  EXPECT_EQ(report(Phase::kLearning).event, Input::kReady);
  node_.disarm();
  EXPECT_TRUE(cable_.wait_for_edges(kPulses - 1)) << "a busy host may skip one";
}

TEST_F(TriggerOnlyNode, fires_every_pulse_of_a_check) {
  node_.arm(order(CommandVerb::kCheck));
  ASSERT_EQ(report(Phase::kArming).event, Input::kReady);
  node_.start();
  EXPECT_EQ(report(Phase::kRecording).text, "pulses have ended");
  node_.drain();
  EXPECT_EQ(report(Phase::kDraining).text, "checked 0 cameras");
  EXPECT_EQ(pulses_commanded(), kPulses);
}

}  // namespace
}  // namespace v3d
