// Tests of the simulator itself: it finds what it is for.
#include "simulation/node_process.h"

#include <gtest/gtest.h>

#include "simulation/truth.h"

namespace v3d::simulation {
namespace {

Truth::Studio studio() {
  Truth::Studio studio;
  studio.commanded.nodes = {"cap1"};
  studio.commanded.trigger = "cap1";
  studio.cameras["cap1"] = {"cam1"};
  return studio;
}

/// The node of the trigger, and the pulses that another host receives.
class TriggerNode : public testing::Test {
 protected:
  TriggerNode() {
    network_.join([](Channel channel, size_t) { return channel == Channel::kPulse; },
                  [this](Channel, size_t, const wire::Bytes&) { ++messages_; });
    events_.add_node("cap1");
    node_.boot();
  }
  void run_for(Duration time) {
    time_.run_until(time_.now() + time, [] { return false; });
  }
  /// Senses pulses, 100 ms apart.
  void sense(int64_t first, int64_t end) {
    for (int64_t pulse = first; pulse < end; ++pulse) {
      node_.on_sensed(pulse);
      run_for(std::chrono::milliseconds(100));
    }
  }

  VirtualTime time_;
  Draws draws_{1};
  Trace trace_{time_, false};
  Network network_{time_, draws_};
  Truth truth_{studio()};
  ProtocolEvents events_;
  const wire::StudioKey key_ = wire::StudioKey::make();
  World world_{time_, draws_, network_, truth_, events_, key_};
  NodeProcess node_{world_, trace_, {.name = "cap1", .cameras = {"cam1"}, .disk = {}}, true};
  int messages_ = 0;
};

TEST_F(TriggerNode, sends_the_pulses_of_a_standstill_when_it_continues) {
  node_.pause();
  sense(0, 3);
  EXPECT_EQ(messages_, 0);
  node_.resume();
  run_for(std::chrono::milliseconds(30));
  EXPECT_EQ(messages_, 3);
}

TEST_F(TriggerNode, loses_the_pulses_of_a_standstill_that_the_kernel_cannot_keep) {
  node_.pause();
  sense(0, 40);
  node_.resume();
  run_for(std::chrono::milliseconds(30));
  EXPECT_EQ(messages_, 16);
  sense(40, 41);
  EXPECT_GT(messages_, 16);
}

TEST_F(TriggerNode, forgets_the_pulses_of_a_standstill_when_it_crashes) {
  node_.pause();
  sense(0, 3);
  node_.crash();
  node_.boot();
  run_for(std::chrono::seconds(1));
  EXPECT_EQ(messages_, 0);
}

TEST(Truth, is_violated_by_a_ledger_that_cannot_be_read_also_when_no_other_can) {
  Truth truth(studio());
  control::Answer answer;
  answer.replies["cap1"].outcome = wire::ReplyMessage::Outcome::kDone;
  answer.replies["cap1"].detail = "{\"cameras\": [";
  wire::CommandMessage stop;
  stop.verb = wire::CommandVerb::kStop;
  truth.on_answer(stop, "ada", 1, answer);
  EXPECT_EQ(truth.violation(), "a ledger is not readable");
}

}  // namespace
}  // namespace v3d::simulation
