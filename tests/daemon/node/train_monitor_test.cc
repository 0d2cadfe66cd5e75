#include <gtest/gtest.h>

#include "daemon/node/peer_health.h"

namespace v3d::node {
namespace {

using namespace std::chrono_literals;

constexpr char kTake[] = "kendo-07";

class TrainStateTest : public testing::Test {
 protected:
  TrainStateTest() { train_.reset(now_); }

  /// The next message of the trigger's node, whose clock shows `sent_s`. It is not received yet.
  ReceivedHealth next(wire::NodeState state, double sent_s = 0) {
    wire::HealthMessage health;
    health.seq = seq_++;
    health.sent = from_ns<Realtime>(0) + from_seconds(sent_s);
    health.node = "cap01";
    health.state = state;
    health.take = state == wire::NodeState::kIdle ? "" : kTake;
    return {.health = health, .session = session_, .received = {}, .sent = {}};
  }
  /// `age`: time since the message was sent.
  void receive(ReceivedHealth message, Duration age = {}) {
    message.received = now_;
    message.sent = now_ - age;
    train_.on_health(message, kTake);
  }
  /// The trigger's node restarts: silence, new session, new sequence numbers.
  void restart_sender() {
    now_ += HealthOrder::kSilence;
    ++session_;
    seq_ = 0;
  }

  MonotonicInstant now_ = from_ns<Monotonic>(0) + 1h;
  uint64_t session_ = 1;
  int64_t seq_ = 0;
  TrainState train_;
};

TEST_F(TrainStateTest, ends_when_the_triggers_node_no_longer_records) {
  receive(next(wire::NodeState::kRecording));
  EXPECT_FALSE(train_.ended());
  receive(next(wire::NodeState::kDraining));
  EXPECT_TRUE(train_.ended());
}

TEST_F(TrainStateTest, does_not_end_by_late_messages_from_before_a_clock_step) {
  const ReceivedHealth before_step = next(wire::NodeState::kIdle, 100);
  const ReceivedHealth after_step = next(wire::NodeState::kIdle, 96);
  receive(after_step);
  receive(before_step);
  EXPECT_FALSE(train_.ended()) << "seed 20153349 of the simulator";
}

TEST_F(TrainStateTest, does_not_end_by_several_late_messages_from_before_it_was_armed) {
  receive(next(wire::NodeState::kIdle, 100));
  now_ += kMaxHealthAge;
  receive(next(wire::NodeState::kIdle, 101));
  EXPECT_FALSE(train_.ended());
}

TEST_F(TrainStateTest, does_not_end_by_a_late_message_while_pulses_run) {
  const ReceivedHealth idle = next(wire::NodeState::kIdle, 100);
  receive(next(wire::NodeState::kRecording, 96));
  receive(idle);
  EXPECT_FALSE(train_.ended());
}

TEST_F(TrainStateTest, ignores_what_is_older_than_messages_before_the_start) {
  const ReceivedHealth draining = next(wire::NodeState::kDraining);
  train_.note(next(wire::NodeState::kArmed));
  train_.reset(now_);
  now_ += kMaxHealthAge + 1s;
  receive(draining);
  EXPECT_FALSE(train_.ended());
}

TEST_F(TrainStateTest, ends_without_pulses_when_the_message_cannot_be_from_before_the_start) {
  now_ += kMaxHealthAge + 1ms;
  receive(next(wire::NodeState::kIdle));
  EXPECT_TRUE(train_.ended());
}

TEST_F(TrainStateTest, ends_when_the_triggers_node_has_restarted_with_a_clock_that_was_set_back) {
  seq_ = 500;
  receive(next(wire::NodeState::kRecording, 100));
  restart_sender();
  receive(next(wire::NodeState::kIdle, 97));
  EXPECT_TRUE(train_.ended());
}

TEST_F(TrainStateTest, ignores_late_messages_of_a_process_that_has_ended) {
  seq_ = 500;
  const ReceivedHealth draining = next(wire::NodeState::kDraining);
  const ReceivedHealth idle = next(wire::NodeState::kIdle);
  train_.note(draining);
  restart_sender();
  receive(next(wire::NodeState::kRecording));
  receive(idle);
  EXPECT_FALSE(train_.ended());
}

TEST_F(TrainStateTest, does_not_end_by_a_second_process_with_the_name_of_the_triggers_node) {
  ReceivedHealth second = next(wire::NodeState::kIdle);
  second.session = session_ + 1;
  receive(next(wire::NodeState::kRecording));
  for (int second_of_take = 0; second_of_take < 20; ++second_of_take) {
    ++second.health.seq;
    receive(second);
    now_ += 1s;
    receive(next(wire::NodeState::kRecording));
    ASSERT_FALSE(train_.ended()) << second_of_take;
  }
  receive(next(wire::NodeState::kDraining));
  EXPECT_TRUE(train_.ended());
}

TEST_F(TrainStateTest, ends_when_the_triggers_node_is_silent_and_another_process_has_its_name) {
  receive(next(wire::NodeState::kRecording));
  restart_sender();
  now_ -= 1ms;
  receive(next(wire::NodeState::kIdle));
  EXPECT_FALSE(train_.ended());
  now_ += 1ms;
  receive(next(wire::NodeState::kIdle));
  EXPECT_TRUE(train_.ended());
}

TEST_F(TrainStateTest, follows_a_restarted_node_although_its_former_messages_were_read_late) {
  receive(next(wire::NodeState::kIdle));
  const ReceivedHealth former = next(wire::NodeState::kIdle);
  restart_sender();
  receive(former, HealthOrder::kSilence);
  receive(next(wire::NodeState::kRecording));
  receive(next(wire::NodeState::kDraining));
  EXPECT_TRUE(train_.ended());
}

TEST_F(TrainStateTest, follows_a_process_at_once_after_the_last_message_of_the_one_before) {
  receive(next(wire::NodeState::kIdle));
  const ReceivedHealth late = next(wire::NodeState::kIdle);
  ReceivedHealth last = next(wire::NodeState::kIdle);
  last.health.values[kStopping] = 1;
  receive(last);
  ++session_;
  seq_ = 0;
  receive(next(wire::NodeState::kRecording));
  receive(late);
  receive(last);
  EXPECT_FALSE(train_.ended()) << "messages of the former process";
  receive(next(wire::NodeState::kDraining));
  EXPECT_TRUE(train_.ended());
}

TEST_F(TrainStateTest, ends_at_once_after_it_was_rejoined) {
  ASSERT_EQ(train_.running(next(wire::NodeState::kRecording)).value().take, kTake);
  receive(next(wire::NodeState::kIdle));
  EXPECT_TRUE(train_.ended());
}

TEST_F(TrainStateTest, ends_again_in_the_next_take) {
  receive(next(wire::NodeState::kRecording));
  receive(next(wire::NodeState::kIdle));
  train_.reset(now_);
  EXPECT_FALSE(train_.ended());
  receive(next(wire::NodeState::kRecording));
  receive(next(wire::NodeState::kIdle));
  EXPECT_TRUE(train_.ended());
}

}  // namespace
}  // namespace v3d::node
