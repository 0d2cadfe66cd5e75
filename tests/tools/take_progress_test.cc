#include <gtest/gtest.h>

#include "v3dctl/operate/studio_monitor.h"

namespace v3d::ctl {
namespace {

using std::chrono::seconds;
using State = TakeProgress::State;

class TakeProgressTest : public testing::Test {
 protected:
  void report(const std::string& node, wire::NodeState state) {
    wire::HealthMessage health;
    health.node = node;
    health.state = state;
    progress_.on_health(health, now_);
  }
  void all_record() {
    for (const char* node : {"cap01", "cap02", "recon01"})
      report(node, wire::NodeState::kRecording);
  }
  State state() const { return progress_.state(now_); }

  MonotonicInstant now_{seconds(1000)};
  TakeProgress progress_{{"cap01", "cap02", "recon01"}, "cap01", now_};
};

TEST_F(TakeProgressTest, ends_when_the_last_node_has_closed_the_take) {
  EXPECT_EQ(state(), State::kRunning) << "before the first reports";
  all_record();
  report("cap01", wire::NodeState::kIdle);
  report("cap02", wire::NodeState::kDraining);
  report("recon01", wire::NodeState::kIdle);
  EXPECT_EQ(state(), State::kRunning) << "cap02 still closes its files";
  report("cap02", wire::NodeState::kFault);
  EXPECT_EQ(state(), State::kEnded);
  EXPECT_EQ(progress_.health(now_).at("cap02").state, wire::NodeState::kFault);
}

TEST_F(TakeProgressTest, ends_without_a_node_that_died_and_has_no_health_of_it) {
  all_record();
  now_ += TakeProgress::kSilentAfter + seconds(1);
  report("cap01", wire::NodeState::kIdle);
  report("recon01", wire::NodeState::kIdle);
  EXPECT_EQ(state(), State::kEnded);
  EXPECT_FALSE(progress_.health(now_).contains("cap02"));
}

TEST_F(TakeProgressTest, is_unknown_when_the_node_of_the_trigger_died) {
  all_record();
  now_ += TakeProgress::kSilentAfter + seconds(1);
  report("cap02", wire::NodeState::kRecording);
  report("recon01", wire::NodeState::kRecording);
  EXPECT_EQ(state(), State::kTriggerIsSilent);
}

}  // namespace
}  // namespace v3d::ctl
