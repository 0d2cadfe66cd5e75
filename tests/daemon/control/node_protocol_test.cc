#include "daemon/control/node_protocol.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <vector>

#include "daemon/control/take_name.h"

namespace v3d::control {
namespace {

using testing::HasSubstr;

/// A delegate that throws in a chosen function, like file operations do.
class FailingWork : public NodeDelegate {
 public:
  std::string fails_in;  ///< name of a function
  std::optional<wire::CommandMessage> running_take;

  void arm(const wire::CommandMessage& /*order*/) override { fail_in("arm"); }
  void learn(const wire::CommandMessage& /*order*/) override {}
  void start() override { fail_in("start"); }
  void drain() override { fail_in("drain"); }
  void disarm() override { fail_in("disarm"); }
  std::optional<wire::CommandMessage> rejoin() override {
    fail_in("rejoin");
    return running_take;
  }
  std::optional<NodeReport> poll(Phase phase) override {
    fail_in("poll");
    if (phase != Phase::kArming) return std::nullopt;
    return NodeReport{.event = Input::kReady, .text = "ready", .detail = {}};
  }
  void report_health(wire::HealthMessage& /*health*/) override {}
  bool progressed_since(MonotonicInstant /*since*/) const override { return true; }

 private:
  void fail_in(const std::string& function) const {
    if (function != fails_in) return;
    throw std::filesystem::filesystem_error("cannot write", "/takes/kendo-07",
                                            std::make_error_code(std::errc::io_error));
  }
};

class Node : public testing::Test {
 protected:
  void command(wire::CommandVerb verb) {
    wire::CommandMessage order;
    order.verb = verb;
    order.take = "kendo-07";
    order.sender = "operator";
    order.counter = ++counter_;
    protocol_.on_command(order);
  }
  void poll() { protocol_.poll(now_ += NodeProtocol::kPollPeriod, true); }
  const std::string& last_text() const { return replies_.back().text; }

  FailingWork work_;
  std::vector<wire::ReplyMessage> replies_;
  MonotonicInstant now_ = MonotonicInstant(std::chrono::seconds(1000));
  NodeProtocol protocol_{"cap01", work_,
                         [this](wire::ReplyMessage reply) { replies_.push_back(std::move(reply)); },
                         now_};
  int64_t counter_ = 0;
};

TEST_F(Node, refuses_to_arm_when_files_cannot_be_created_and_stays_idle) {
  work_.fails_in = "arm";
  command(wire::CommandVerb::kArm);
  poll();
  EXPECT_EQ(protocol_.phase(), Phase::kIdle);
  EXPECT_THAT(last_text(), HasSubstr("Input/output error [/takes/kendo-07]"));
}

TEST_F(Node, survives_a_disk_error_while_arming) {
  command(wire::CommandVerb::kArm);
  work_.fails_in = "poll";
  poll();
  EXPECT_THAT(last_text(), HasSubstr("Input/output error"));
  EXPECT_NE(protocol_.phase(), Phase::kArming);
  work_.fails_in = "";
  poll();
  command(wire::CommandVerb::kArm);
  poll();
  EXPECT_EQ(protocol_.phase(), Phase::kPrepared) << "the next take is not affected";
}

TEST_F(Node, continues_recording_after_a_disk_error_and_enters_fault_when_it_cannot_close) {
  command(wire::CommandVerb::kArm);
  poll();
  command(wire::CommandVerb::kCommit);
  command(wire::CommandVerb::kStart);
  work_.fails_in = "poll";
  poll();
  EXPECT_EQ(protocol_.phase(), Phase::kRecording);
  command(wire::CommandVerb::kStop);
  poll();
  EXPECT_EQ(protocol_.phase(), Phase::kFault);
  EXPECT_THAT(last_text(), HasSubstr("Input/output error"));
}

TEST_F(Node, reports_that_a_check_and_learning_record_nothing) {
  const auto records_nothing = [&] { return control::records_nothing(protocol_.health(now_)); };
  for (const auto verb : {wire::CommandVerb::kCheck, wire::CommandVerb::kBackground}) {
    command(verb);
    EXPECT_TRUE(records_nothing());
    poll();
    command(wire::CommandVerb::kCommit);
    command(wire::CommandVerb::kStart);
    EXPECT_EQ(protocol_.health(now_).state, wire::NodeState::kRecording) << "for earlier readers";
    EXPECT_TRUE(records_nothing());
    command(wire::CommandVerb::kAbort);
    command(wire::CommandVerb::kAbort);
    EXPECT_EQ(protocol_.phase(), Phase::kIdle);
    EXPECT_FALSE(records_nothing());
  }
  command(wire::CommandVerb::kArm);
  poll();
  command(wire::CommandVerb::kCommit);
  command(wire::CommandVerb::kStart);
  EXPECT_EQ(protocol_.health(now_).state, wire::NodeState::kRecording);
  EXPECT_FALSE(records_nothing());
}

TEST_F(Node, survives_a_disk_error_while_rejoining) {
  work_.fails_in = "rejoin";
  poll();
  EXPECT_EQ(protocol_.phase(), Phase::kIdle);
}

TEST_F(Node, rejoins_a_running_take_unless_it_has_answered_a_stop_with_its_ledger) {
  work_.running_take.emplace().take = "kendo-07";
  protocol_.set_last_result("kendo-07", "recovered", "{}");
  command(wire::CommandVerb::kStop);
  EXPECT_EQ(last_text(), "recovered");
  poll();
  EXPECT_EQ(protocol_.phase(), Phase::kIdle) << "seed 20169961 of the simulator";
  NodeProtocol restarted(
      "cap01", work_, [](const wire::ReplyMessage&) {}, now_);
  restarted.poll(now_, true);
  EXPECT_EQ(restarted.phase(), Phase::kRecording);
}

TEST_F(Node, survives_a_disk_error_while_disarming) {
  command(wire::CommandVerb::kArm);
  poll();
  work_.fails_in = "disarm";
  command(wire::CommandVerb::kAbort);
  EXPECT_EQ(protocol_.phase(), Phase::kIdle);
}

TEST_F(Node, has_the_take_of_a_command_when_it_records_it_or_recorded_it_last) {
  wire::CommandMessage stop;
  stop.verb = wire::CommandVerb::kStop;
  stop.take = "kendo-07";
  EXPECT_FALSE(protocol_.has_take_of(stop));
  command(wire::CommandVerb::kArm);
  EXPECT_TRUE(protocol_.has_take_of(stop));
  command(wire::CommandVerb::kAbort);
  EXPECT_FALSE(protocol_.has_take_of(stop));
  protocol_.set_last_result("kendo-07", "recovered", "");
  EXPECT_TRUE(protocol_.has_take_of(stop));
  stop.take = "kendo-08";
  EXPECT_FALSE(protocol_.has_take_of(stop));
}

}  // namespace
}  // namespace v3d::control
