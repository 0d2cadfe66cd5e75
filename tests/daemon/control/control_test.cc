#include "daemon/control/control.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

namespace v3d::control {
namespace {

using Outcome = wire::ReplyMessage::Outcome;
using testing::HasSubstr;

constexpr Phase kPhases[] = {Phase::kIdle,      Phase::kArming,   Phase::kPrepared, Phase::kArmed,
                             Phase::kRecording, Phase::kDraining, Phase::kLearning, Phase::kFault};
constexpr Input kInputs[] = {
    Input::kArm,    Input::kStart,      Input::kStop,    Input::kAbort,   Input::kBackground,
    Input::kCommit, Input::kLearn,      Input::kCheck,   Input::kExpired, Input::kReady,
    Input::kFailed, Input::kTrainEnded, Input::kDrained, Input::kBroken,  Input::kRejoined};

bool pulses_may_run(Phase phase) { return phase == Phase::kRecording || phase == Phase::kLearning; }

// The full table. A pair that is not listed here keeps its phase; commands are refused.
TEST(Transition, matches_the_expected_table) {
  const auto row = [](Phase from, Input input, Transition expected) {
    EXPECT_EQ(transition(from, input), expected)
        << "phase " << int(from) << ", input " << int(input);
  };
  using enum Phase;
  using enum Verdict;
  row(kIdle, Input::kArm, {kArming, Work::kArm, kPending});
  row(kIdle, Input::kBackground, {kArming, Work::kLearn, kPending});
  row(kIdle, Input::kCheck, {kArming, Work::kArm, kPending});
  row(kIdle, Input::kAbort, {kIdle, Work::kNone, kDone});
  row(kIdle, Input::kRejoined, {kRecording, Work::kNone, kNone});
  row(kArming, Input::kReady, {kPrepared, Work::kNone, kNone});
  row(kArming, Input::kFailed, {kIdle, Work::kDisarm, kNone});
  row(kArming, Input::kAbort, {kIdle, Work::kDisarm, kDone});
  row(kPrepared, Input::kCommit, {kArmed, Work::kNone, kDone});
  row(kPrepared, Input::kExpired, {kIdle, Work::kDisarm, kNone});
  row(kPrepared, Input::kAbort, {kIdle, Work::kDisarm, kDone});
  row(kLearning, Input::kLearn, {kLearning, Work::kNone, kDone});
  row(kLearning, Input::kStop, {kLearning, Work::kNone, kPending});
  row(kLearning, Input::kReady, {kIdle, Work::kDisarm, kNone});
  row(kLearning, Input::kFailed, {kIdle, Work::kDisarm, kNone});
  row(kLearning, Input::kAbort, {kIdle, Work::kDisarm, kDone});
  row(kArmed, Input::kCommit, {kArmed, Work::kNone, kDone});
  row(kArmed, Input::kStart, {kRecording, Work::kStart, kDone});
  row(kArmed, Input::kLearn, {kLearning, Work::kStart, kDone});
  row(kArmed, Input::kStop, {kIdle, Work::kDisarm, kDone});
  row(kArmed, Input::kAbort, {kIdle, Work::kDisarm, kDone});
  row(kRecording, Input::kStart, {kRecording, Work::kNone, kDone});
  row(kRecording, Input::kStop, {kDraining, Work::kDrain, kPending});
  row(kRecording, Input::kAbort, {kDraining, Work::kDrain, kPending});
  row(kRecording, Input::kTrainEnded, {kDraining, Work::kDrain, kNone});
  row(kDraining, Input::kStop, {kDraining, Work::kNone, kPending});
  row(kDraining, Input::kAbort, {kIdle, Work::kDisarm, kDone});
  row(kDraining, Input::kDrained, {kIdle, Work::kDisarm, kNone});
  row(kFault, Input::kAbort, {kIdle, Work::kDisarm, kDone});
}

TEST(Transition, starts_pulses_only_when_all_nodes_are_ready) {
  for (const Phase phase : kPhases) {
    for (const Input input : kInputs) {
      const bool starts = transition(phase, input).work == Work::kStart;
      EXPECT_EQ(starts,
                phase == Phase::kArmed && (input == Input::kStart || input == Input::kLearn));
    }
  }
}

TEST(Transition, stops_pulses_when_it_leaves_a_phase_with_pulses) {
  for (const Phase phase : kPhases) {
    for (const Input input : kInputs) {
      const Transition t = transition(phase, input);
      if (pulses_may_run(phase) && !pulses_may_run(t.next)) {
        EXPECT_TRUE(t.work == Work::kDrain || t.work == Work::kDisarm);
      }
    }
  }
}

TEST(Transition, changes_nothing_when_it_refuses_and_replies_only_to_commands) {
  for (const Phase phase : kPhases) {
    for (const Input input : kInputs) {
      const Transition t = transition(phase, input);
      if (t.verdict == Verdict::kRefused) {
        EXPECT_EQ(t, (Transition{phase, Work::kNone, Verdict::kRefused}));
      }
      EXPECT_EQ(t.verdict != Verdict::kNone, is_command(input));
    }
  }
}

TEST(Transition, enters_fault_from_every_phase_and_leaves_it_only_by_abort) {
  for (const Phase phase : kPhases) {
    EXPECT_EQ(transition(phase, Input::kBroken).next, Phase::kFault);
  }
  for (const Input input : kInputs) {
    EXPECT_EQ(transition(Phase::kFault, input).next,
              input == Input::kAbort ? Phase::kIdle : Phase::kFault);
  }
}

TEST(Transition, reaches_idle_from_every_phase_with_two_aborts) {
  for (const Phase phase : kPhases) {
    EXPECT_EQ(transition(transition(phase, Input::kAbort).next, Input::kAbort).next, Phase::kIdle);
  }
}

wire::CommandMessage command(wire::CommandVerb verb, int64_t counter,
                             const std::string& take = "kendo-07") {
  wire::CommandMessage m;
  m.sender = "v3dctl.1";
  m.counter = counter;
  m.verb = verb;
  m.take = take;
  return m;
}

class ControllerTest : public testing::Test {
 protected:
  /// The only reply to a command.
  wire::ReplyMessage send(const wire::CommandMessage& m) {
    last_ = controller_.on_command(m);
    EXPECT_EQ(last_.replies.size(), 1U);
    return last_.replies.empty() ? wire::ReplyMessage{} : last_.replies[0];
  }
  void arm_and_start() {
    send(command(wire::CommandVerb::kArm, 1));
    controller_.on_event(Input::kReady, "15 cameras");
    send(command(wire::CommandVerb::kCommit, 2));
    send(command(wire::CommandVerb::kStart, 3));
  }

  Controller controller_{"cap01"};
  Controller::Step last_;
};

TEST_F(ControllerTest, does_not_rejoin_a_take_after_a_stop_was_answered_with_its_ledger) {
  controller_.set_last_result("kendo-07", "recovered", "{}");
  EXPECT_TRUE(controller_.may_rejoin());
  EXPECT_EQ(send(command(wire::CommandVerb::kStop, 1)).text, "recovered");
  EXPECT_FALSE(controller_.may_rejoin()) << "seed 20169961 of the simulator";
  controller_.rejoined(command(wire::CommandVerb::kArm, 7));
  EXPECT_EQ(controller_.phase(), Phase::kIdle);
}

TEST_F(ControllerTest, stops_a_rejoined_take) {
  controller_.set_last_result("kendo-07", "recovered", "{}");
  controller_.rejoined(command(wire::CommandVerb::kArm, 7));
  EXPECT_EQ(controller_.phase(), Phase::kRecording);
  EXPECT_EQ(controller_.order().take, "kendo-07");
  EXPECT_EQ(send(command(wire::CommandVerb::kStop, 2)).outcome, Outcome::kPending);
  EXPECT_EQ(last_.work, Work::kDrain);
  EXPECT_EQ(controller_.on_event(Input::kDrained, "incomplete").replies.at(0).text, "incomplete");
}

TEST_F(ControllerTest, does_not_reply_with_an_earlier_take_after_an_abort) {
  arm_and_start();
  send(command(wire::CommandVerb::kStop, 4));
  controller_.on_event(Input::kDrained, "kendo-07: complete", "{}");
  EXPECT_EQ(send(command(wire::CommandVerb::kStop, 5, "")).text, "kendo-07: complete");
  send(command(wire::CommandVerb::kArm, 6, "kendo-08"));
  controller_.on_event(Input::kReady, "15 cameras");
  send(command(wire::CommandVerb::kCommit, 7, "kendo-08"));
  send(command(wire::CommandVerb::kStart, 8, "kendo-08"));
  controller_.on_event(Input::kTrainEnded, "pulses have ended");
  EXPECT_EQ(send(command(wire::CommandVerb::kAbort, 9, "kendo-08")).outcome, Outcome::kDone);
  EXPECT_EQ(send(command(wire::CommandVerb::kStop, 10, "")).outcome, Outcome::kRefused);
}

TEST_F(ControllerTest, does_not_reply_with_a_recovered_ledger_after_rejoining) {
  controller_.set_last_result("kendo-07", "recovered 6 pulses", "{}");
  controller_.rejoined(command(wire::CommandVerb::kArm, 7));
  controller_.on_event(Input::kTrainEnded, "pulses have ended");
  EXPECT_EQ(send(command(wire::CommandVerb::kAbort, 1)).outcome, Outcome::kDone);
  EXPECT_EQ(send(command(wire::CommandVerb::kStop, 2, "")).outcome, Outcome::kRefused);
}

TEST_F(ControllerTest, does_not_rejoin_after_a_new_order) {
  send(command(wire::CommandVerb::kArm, 1, "kendo-08"));
  controller_.rejoined(command(wire::CommandVerb::kArm, 7));
  EXPECT_EQ(controller_.phase(), Phase::kArming);
  EXPECT_EQ(controller_.order().take, "kendo-08");
}

TEST_F(ControllerTest, runs_a_take_from_arm_to_ledger) {
  const wire::ReplyMessage armed = send(command(wire::CommandVerb::kArm, 1));
  EXPECT_EQ(armed.outcome, Outcome::kPending);
  EXPECT_EQ(armed.node, "cap01");
  EXPECT_EQ(armed.command_sender, "v3dctl.1");
  EXPECT_EQ(armed.command_counter, 1);
  EXPECT_EQ(last_.work, Work::kArm);

  const auto ready = controller_.on_event(Input::kReady, "15 cameras");
  ASSERT_EQ(ready.replies.size(), 1U);
  EXPECT_EQ(ready.replies[0].outcome, Outcome::kDone);
  EXPECT_EQ(ready.replies[0].text, "15 cameras");
  EXPECT_EQ(controller_.phase(), Phase::kPrepared);

  EXPECT_EQ(send(command(wire::CommandVerb::kCommit, 2)).outcome, Outcome::kDone);
  EXPECT_EQ(controller_.phase(), Phase::kArmed);
  EXPECT_EQ(send(command(wire::CommandVerb::kStart, 3)).outcome, Outcome::kDone);
  EXPECT_EQ(last_.work, Work::kStart);
  EXPECT_EQ(send(command(wire::CommandVerb::kStop, 4)).outcome, Outcome::kPending);
  EXPECT_EQ(last_.work, Work::kDrain);

  const auto drained = controller_.on_event(Input::kDrained, "complete", "{}");
  EXPECT_EQ(drained.work, Work::kDisarm);
  ASSERT_EQ(drained.replies.size(), 1U);
  EXPECT_EQ(drained.replies[0].command_counter, 4);
  EXPECT_EQ(drained.replies[0].detail, "{}");
  EXPECT_EQ(drained.replies[0].take, "kendo-07");
  EXPECT_EQ(controller_.phase(), Phase::kIdle);
}

TEST_F(ControllerTest, answers_a_retry_without_executing_it_again) {
  arm_and_start();
  const auto again = controller_.on_command(command(wire::CommandVerb::kStart, 3));
  EXPECT_EQ(again.work, Work::kNone);
  ASSERT_EQ(again.replies.size(), 1U);
  EXPECT_EQ(again.replies[0].outcome, Outcome::kDone);
  EXPECT_EQ(controller_.phase(), Phase::kRecording);
}

TEST_F(ControllerTest, answers_the_retry_of_a_pending_command_with_its_final_reply) {
  send(command(wire::CommandVerb::kArm, 1));
  EXPECT_EQ(send(command(wire::CommandVerb::kArm, 1)).outcome, Outcome::kPending);
  controller_.on_event(Input::kReady, "15 cameras");
  const wire::ReplyMessage again = send(command(wire::CommandVerb::kArm, 1));
  EXPECT_EQ(again.outcome, Outcome::kDone);
  EXPECT_EQ(again.text, "15 cameras");
}

TEST_F(ControllerTest, ignores_a_command_that_arrives_after_a_later_one) {
  arm_and_start();
  const auto late = controller_.on_command(command(wire::CommandVerb::kArm, 1));
  EXPECT_TRUE(late.replies.empty());
  EXPECT_EQ(late.work, Work::kNone);
  EXPECT_EQ(controller_.phase(), Phase::kRecording);
}

wire::CommandMessage by(const std::string& sender, wire::CommandMessage m) {
  m.sender = sender;
  return m;
}

TEST_F(ControllerTest, names_the_first_operator_in_refusals_to_the_second) {
  send(by("anna@desk/12/34", command(wire::CommandVerb::kArm, 1)));
  const wire::CommandMessage second =
      by("ben@stage/5/6", command(wire::CommandVerb::kArm, 1, "kendo-08"));
  const wire::ReplyMessage refusal = send(second);
  EXPECT_EQ(refusal.outcome, Outcome::kRefused);
  EXPECT_THAT(refusal.text, HasSubstr("being armed for kendo-07 by anna@desk;"));
}

TEST_F(ControllerTest, refuses_commits_and_take_backs_of_other_operators) {
  send(by("anna", command(wire::CommandVerb::kArm, 1)));
  wire::CommandMessage undo = by("ben", command(wire::CommandVerb::kAbort, 1));
  undo.own_only = true;
  EXPECT_EQ(send(undo).outcome, Outcome::kRefused);
  controller_.on_event(Input::kReady, "15 cameras");
  EXPECT_EQ(send(by("ben", command(wire::CommandVerb::kCommit, 2))).outcome, Outcome::kRefused);
  EXPECT_EQ(controller_.phase(), Phase::kPrepared);
  EXPECT_EQ(send(by("anna", command(wire::CommandVerb::kCommit, 2))).outcome, Outcome::kDone);
}

TEST_F(ControllerTest, keeps_a_running_take_when_a_later_start_is_taken_back) {
  arm_and_start();
  EXPECT_EQ(send(by("ben", command(wire::CommandVerb::kStart, 1))).outcome, Outcome::kDone);
  wire::CommandMessage undo = by("ben", command(wire::CommandVerb::kAbort, 2));
  undo.own_only = true;
  EXPECT_EQ(send(undo).outcome, Outcome::kRefused);
  EXPECT_EQ(controller_.phase(), Phase::kRecording);
}

TEST_F(ControllerTest, becomes_idle_without_a_commit) {
  send(command(wire::CommandVerb::kArm, 1));
  controller_.on_event(Input::kReady, "15 cameras");
  EXPECT_EQ(controller_.on_event(Input::kExpired, "not confirmed").work, Work::kDisarm);
  EXPECT_EQ(controller_.phase(), Phase::kIdle);
  EXPECT_EQ(send(command(wire::CommandVerb::kCommit, 2)).outcome, Outcome::kRefused);
}

TEST_F(ControllerTest, learns_the_background_after_start_and_replies_the_result_to_stop) {
  send(command(wire::CommandVerb::kBackground, 1, "background"));
  EXPECT_EQ(last_.work, Work::kLearn);
  controller_.on_event(Input::kReady, "15 cameras");
  send(command(wire::CommandVerb::kCommit, 2, "background"));
  EXPECT_EQ(send(command(wire::CommandVerb::kStart, 3, "background")).outcome, Outcome::kDone);
  EXPECT_EQ(last_.work, Work::kStart);
  EXPECT_EQ(controller_.phase(), Phase::kLearning);
  controller_.on_event(Input::kFailed, "cam03: only 2 of 16 plates arrived");
  const wire::ReplyMessage result = send(command(wire::CommandVerb::kStop, 4, "background"));
  EXPECT_EQ(result.outcome, Outcome::kRefused);
  EXPECT_THAT(result.text, HasSubstr("cam03"));
}

TEST_F(ControllerTest, replies_with_the_take_recovered_after_a_restart) {
  controller_.set_last_result("kendo-07", "recovered", "{\"take\":\"kendo-07\"}");
  const wire::ReplyMessage reply = send(command(wire::CommandVerb::kStop, 1));
  EXPECT_EQ(reply.outcome, Outcome::kDone);
  EXPECT_EQ(reply.detail, "{\"take\":\"kendo-07\"}");
  EXPECT_EQ(send(command(wire::CommandVerb::kStop, 2, "kendo-08")).outcome, Outcome::kRefused);
}

TEST_F(ControllerTest, refuses_to_start_or_stop_another_take) {
  arm_and_start();
  EXPECT_THAT(send(command(wire::CommandVerb::kStop, 4, "kendo-08")).text,
              HasSubstr("the take here is kendo-07, not kendo-08"));
  EXPECT_EQ(controller_.phase(), Phase::kRecording);
}

TEST_F(ControllerTest, replies_why_arming_failed) {
  send(command(wire::CommandVerb::kArm, 1));
  const auto failed = controller_.on_event(Input::kFailed, "not ready: cam07 (opening)");
  EXPECT_EQ(failed.work, Work::kDisarm);
  ASSERT_EQ(failed.replies.size(), 1U);
  EXPECT_EQ(failed.replies[0].outcome, Outcome::kRefused);
  EXPECT_EQ(failed.replies[0].text, "not ready: cam07 (opening)");
  EXPECT_EQ(controller_.phase(), Phase::kIdle);
}

TEST_F(ControllerTest, replies_the_ledger_of_a_train_that_ended_by_itself) {
  arm_and_start();
  EXPECT_TRUE(controller_.on_event(Input::kTrainEnded, "pulses have ended").replies.empty());
  controller_.on_event(Input::kDrained, "complete", "{\"complete\":true}");
  const wire::ReplyMessage reply = send(command(wire::CommandVerb::kStop, 4));
  EXPECT_EQ(reply.outcome, Outcome::kDone);
  EXPECT_EQ(reply.detail, "{\"complete\":true}");
  EXPECT_EQ(send(command(wire::CommandVerb::kStop, 5, "kendo-01")).outcome, Outcome::kRefused);
}

TEST_F(ControllerTest, answers_a_stop_that_arrives_while_draining) {
  arm_and_start();
  controller_.on_event(Input::kTrainEnded, "pulses have ended");
  EXPECT_EQ(send(command(wire::CommandVerb::kStop, 4)).outcome, Outcome::kPending);
  EXPECT_EQ(controller_.on_event(Input::kDrained, "complete").replies.size(), 1U);
}

TEST_F(ControllerTest, refuses_the_pending_arm_command_after_an_abort) {
  send(command(wire::CommandVerb::kArm, 1));
  wire::CommandMessage abort = command(wire::CommandVerb::kAbort, 1);
  abort.sender = "v3dctl.2";
  const auto step = controller_.on_command(abort);
  EXPECT_EQ(step.work, Work::kDisarm);
  ASSERT_EQ(step.replies.size(), 2U);
  EXPECT_EQ(step.replies[1].command_sender, "v3dctl.1");
  EXPECT_EQ(step.replies[1].outcome, Outcome::kRefused);
}

TEST_F(ControllerTest, replies_its_fault_until_it_is_cleared) {
  arm_and_start();
  EXPECT_EQ(controller_.on_event(Input::kBroken, "the disk is gone").work, Work::kDisarm);
  EXPECT_EQ(send(command(wire::CommandVerb::kArm, 4)).text, "the disk is gone");
  EXPECT_EQ(send(command(wire::CommandVerb::kAbort, 5)).outcome, Outcome::kDone);
  EXPECT_EQ(send(command(wire::CommandVerb::kArm, 6)).outcome, Outcome::kPending);
}

TEST_F(ControllerTest, refuses_the_start_when_pulses_could_not_be_started) {
  arm_and_start();
  const auto step = controller_.on_start_failed("the cable is gone");
  EXPECT_EQ(step.work, Work::kDisarm);
  ASSERT_EQ(step.replies.size(), 1U);
  EXPECT_EQ(step.replies[0].outcome, Outcome::kRefused);
  EXPECT_EQ(send(command(wire::CommandVerb::kStart, 3)).text, "the cable is gone");
}

TEST_F(ControllerTest, remembers_a_bounded_number_of_senders) {
  arm_and_start();
  for (int i = 0; i < 1000; ++i) {
    wire::CommandMessage m = command(wire::CommandVerb::kArm, 1);
    m.sender = "stranger" + std::to_string(i);
    EXPECT_EQ(send(m).outcome, Outcome::kRefused);
  }
  EXPECT_EQ(controller_.phase(), Phase::kRecording);
}

RC_GTEST_PROP(ControllerProperty, replies_once_to_every_command, ()) {
  Controller controller("cap01");
  constexpr int kVerbs = 6;
  constexpr Input kReports[] = {Input::kReady,   Input::kFailed, Input::kExpired,
                                Input::kDrained, Input::kBroken, Input::kTrainEnded};
  const auto steps = *rc::gen::container<std::vector<int>>(rc::gen::inRange(0, 2 * kVerbs));
  int64_t counter = 0;
  for (const int step : steps) {
    if (step >= kVerbs) {
      controller.on_event(kReports[step - kVerbs], "text");
      continue;
    }
    const auto verb = static_cast<wire::CommandVerb>(step + 1);
    const auto first = controller.on_command(command(verb, ++counter));
    const Phase after = controller.phase();
    RC_ASSERT(!first.replies.empty());
    const auto second = controller.on_command(command(verb, counter));
    RC_ASSERT(second.work == Work::kNone);
    RC_ASSERT(second.replies.size() == 1U);
    RC_ASSERT(second.replies[0].outcome == first.replies[0].outcome);
    RC_ASSERT(controller.phase() == after);
  }
}

}  // namespace
}  // namespace v3d::control
