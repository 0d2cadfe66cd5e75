#include "daemon/control/studio_coordinator.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

#include "daemon/simulated_crew.h"

namespace v3d::control {
namespace {

using namespace std::chrono_literals;
using test::NetworkConditions;
using test::SimulatedOperator;
using test::SimulatedStudio;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;
using Outcome = wire::ReplyMessage::Outcome;

const CommandTargets kStudio = {{"cap01", "cap02", "recon01"}, "cap01"};

class CoordinatorTest : public testing::Test {
 protected:
  StudioCoordinator begin(wire::CommandVerb verb, const std::string& take = "",
                          const CommandTargets& studio = kStudio) {
    wire::CommandMessage order;
    order.verb = verb;
    order.take = take;
    return {order, 0, studio, now_ + 10s};
  }
  /// The message that is due now: "arm@cap01,cap02", or "" when nothing is due.
  std::string sent(StudioCoordinator& coordinator) {
    last_ = coordinator.poll(now_);
    if (!last_) return "";
    std::string text(name(last_->verb));
    for (size_t i = 0; i < last_->to.size(); ++i) text += (i > 0 ? "," : "@") + last_->to[i];
    return text;
  }
  /// `take`: empty for that of the command, or kendo-07 where it names none.
  void reply(StudioCoordinator& coordinator, const std::string& node, Outcome outcome,
             const std::string& text = "", const std::string& take = "") {
    wire::ReplyMessage reply;
    reply.node = node;
    reply.command_counter = last_->counter;
    reply.outcome = outcome;
    reply.take = !take.empty() ? take : last_->take.empty() ? "kendo-07" : last_->take;
    reply.text = text;
    coordinator.on_reply(reply);
  }
  void all_reply(StudioCoordinator& coordinator, Outcome outcome) {
    const std::vector<std::string> to = last_->to;
    for (const std::string& node : to) reply(coordinator, node, outcome, "well");
  }

  MonotonicInstant now_ = from_ns<Monotonic>(1'000'000'000);
  std::optional<wire::CommandMessage> last_;
};

TEST_F(CoordinatorTest, arms_the_triggers_node_then_all_and_commits_when_every_node_is_ready) {
  StudioCoordinator coordinator = begin(wire::CommandVerb::kArm, "kendo-07");
  EXPECT_EQ(sent(coordinator), "arm@cap01");
  reply(coordinator, "cap01", Outcome::kPending);
  EXPECT_EQ(sent(coordinator), "arm@cap01,cap02,recon01");
  reply(coordinator, "recon01", Outcome::kDone, "reconstructs at 10 mm");
  reply(coordinator, "cap01", Outcome::kDone);
  EXPECT_EQ(sent(coordinator), "") << "not due again yet";
  now_ += StudioCoordinator::kRepeatAfter;
  EXPECT_EQ(sent(coordinator), "arm@cap02");
  reply(coordinator, "cap02", Outcome::kDone);
  EXPECT_EQ(sent(coordinator), "commit@cap01,cap02,recon01");
  all_reply(coordinator, Outcome::kDone);
  EXPECT_TRUE(coordinator.is_finished());
  EXPECT_TRUE(coordinator.answer().done());
  EXPECT_EQ(coordinator.answer().replies.at("recon01").text, "reconstructs at 10 mm");
}

TEST_F(CoordinatorTest, stops_after_a_refusal_of_the_trigger_s_node) {
  StudioCoordinator coordinator = begin(wire::CommandVerb::kArm, "kendo-08");
  sent(coordinator);
  reply(coordinator, "cap01", Outcome::kRefused, "armed for kendo-07 by anna@desk already");
  EXPECT_TRUE(coordinator.is_finished()) << "nothing to take back";
  EXPECT_FALSE(coordinator.answer().done());
  EXPECT_EQ(coordinator.answer().replies.size(), 1U);
  EXPECT_THAT(coordinator.answer().silent, IsEmpty());
}

TEST_F(CoordinatorTest, takes_back_what_was_armed_when_one_node_refuses) {
  StudioCoordinator coordinator = begin(wire::CommandVerb::kArm, "kendo-07");
  sent(coordinator);
  reply(coordinator, "cap01", Outcome::kDone);
  sent(coordinator);
  reply(coordinator, "cap02", Outcome::kRefused, "cam07 is silent");
  reply(coordinator, "recon01", Outcome::kDone);
  EXPECT_EQ(sent(coordinator), "abort@cap01,cap02,recon01");
  EXPECT_TRUE(last_->own_only);
  EXPECT_EQ(last_->take, "kendo-07");
  all_reply(coordinator, Outcome::kDone);
  EXPECT_TRUE(coordinator.is_finished());
  EXPECT_EQ(coordinator.answer().replies.at("cap02").text, "cam07 is silent");
}

TEST_F(CoordinatorTest, lists_a_silent_node_and_takes_back_the_others) {
  StudioCoordinator coordinator = begin(wire::CommandVerb::kArm, "kendo-07");
  sent(coordinator);
  reply(coordinator, "cap01", Outcome::kDone);
  sent(coordinator);
  reply(coordinator, "recon01", Outcome::kDone);
  now_ += 10s;
  EXPECT_EQ(sent(coordinator), "abort@cap01,cap02,recon01");
  now_ += StudioCoordinator::kTakeBackTimeout;
  EXPECT_EQ(sent(coordinator), "");
  EXPECT_TRUE(coordinator.is_finished());
  EXPECT_THAT(coordinator.answer().silent, ElementsAre("cap02"));
}

TEST_F(CoordinatorTest, starts_the_trigger_s_node_last_for_the_take_of_the_others) {
  StudioCoordinator coordinator = begin(wire::CommandVerb::kStart);
  EXPECT_EQ(sent(coordinator), "start@cap02,recon01");
  all_reply(coordinator, Outcome::kDone);
  EXPECT_EQ(sent(coordinator), "start@cap01");
  EXPECT_EQ(last_->take, "kendo-07");
  all_reply(coordinator, Outcome::kDone);
  EXPECT_TRUE(coordinator.is_finished());
  EXPECT_EQ(coordinator.answer().replies.size(), 3U);
}

TEST_F(CoordinatorTest, repeats_a_start_for_the_take_that_the_first_node_has_started) {
  StudioCoordinator coordinator = begin(wire::CommandVerb::kStart);
  sent(coordinator);
  EXPECT_EQ(last_->take, "");
  reply(coordinator, "cap02", Outcome::kDone);
  now_ += StudioCoordinator::kRepeatAfter;
  EXPECT_EQ(sent(coordinator), "start@recon01");
  EXPECT_EQ(last_->take, "kendo-07") << "seed 20150232 of the simulator";
}

TEST_F(CoordinatorTest, repeats_a_stop_for_the_take_that_the_first_node_stops) {
  StudioCoordinator coordinator = begin(wire::CommandVerb::kStop);
  sent(coordinator);
  now_ += StudioCoordinator::kTriggerTimeout + 1ms;
  EXPECT_EQ(sent(coordinator), "stop@cap01,cap02,recon01");
  reply(coordinator, "cap02", Outcome::kDone, "complete", "kendo-06");
  now_ += StudioCoordinator::kRepeatAfter;
  EXPECT_EQ(sent(coordinator), "stop@cap01,recon01");
  EXPECT_EQ(last_->take, "") << "the result of an earlier take";
  reply(coordinator, "recon01", Outcome::kPending);
  now_ += StudioCoordinator::kRepeatAfter;
  EXPECT_EQ(sent(coordinator), "stop@cap01,recon01");
  EXPECT_EQ(last_->take, "kendo-07");
}

TEST_F(CoordinatorTest, starts_no_pulses_when_a_node_has_started_another_take) {
  StudioCoordinator coordinator = begin(wire::CommandVerb::kStart);
  sent(coordinator);
  reply(coordinator, "cap02", Outcome::kDone);
  reply(coordinator, "recon01", Outcome::kDone, "recording kendo-08", "kendo-08");
  EXPECT_EQ(sent(coordinator), "abort@cap01") << "seed 20150232 of the simulator";
  EXPECT_TRUE(last_->own_only);
  EXPECT_EQ(last_->take, "kendo-07");
  all_reply(coordinator, Outcome::kRefused);
  EXPECT_TRUE(coordinator.is_finished());
  EXPECT_FALSE(coordinator.answer().done());
  EXPECT_EQ(coordinator.answer().replies.at("recon01").text,
            "the take here is kendo-08, not kendo-07");
}

TEST_F(CoordinatorTest, starts_no_pulses_when_one_node_is_not_armed) {
  StudioCoordinator coordinator = begin(wire::CommandVerb::kStart);
  sent(coordinator);
  reply(coordinator, "cap02", Outcome::kRefused, "not armed");
  reply(coordinator, "recon01", Outcome::kDone);
  EXPECT_EQ(sent(coordinator), "abort@cap01");
  EXPECT_TRUE(last_->own_only);
  reply(coordinator, "cap01", Outcome::kDone, "aborted");
  EXPECT_EQ(sent(coordinator), "abort@cap02,recon01");
  EXPECT_FALSE(last_->own_only);
  EXPECT_EQ(last_->take, "kendo-07");
}

TEST_F(CoordinatorTest, takes_no_start_back_while_the_trigger_s_node_is_silent) {
  StudioCoordinator coordinator = begin(wire::CommandVerb::kStart);
  sent(coordinator);
  all_reply(coordinator, Outcome::kDone);
  EXPECT_EQ(sent(coordinator), "start@cap01");
  now_ += 10s;
  for (int i = 0; i < 14; ++i) {
    EXPECT_EQ(sent(coordinator), "abort@cap01") << "pulses may run";
    now_ += StudioCoordinator::kRepeatAfter;
  }
  now_ += StudioCoordinator::kTakeBackTimeout;
  EXPECT_EQ(sent(coordinator), "");
  EXPECT_TRUE(coordinator.is_finished());
  EXPECT_THAT(coordinator.answer().silent, ElementsAre("cap01"));
}

TEST_F(CoordinatorTest, keeps_a_running_take_when_a_second_start_is_refused) {
  StudioCoordinator coordinator = begin(wire::CommandVerb::kStart);
  sent(coordinator);
  reply(coordinator, "cap02", Outcome::kRefused, "not armed");
  reply(coordinator, "recon01", Outcome::kDone);
  sent(coordinator);
  reply(coordinator, "cap01", Outcome::kRefused, "recording kendo-07 already");
  EXPECT_TRUE(coordinator.is_finished());
}

TEST_F(CoordinatorTest, stops_the_triggers_node_first_and_all_when_it_is_silent) {
  StudioCoordinator coordinator = begin(wire::CommandVerb::kStop);
  EXPECT_EQ(sent(coordinator), "stop@cap01");
  now_ += StudioCoordinator::kTriggerTimeout + 1ms;
  EXPECT_EQ(sent(coordinator), "stop@cap01,cap02,recon01");
}

TEST_F(CoordinatorTest, stops_the_others_when_the_triggers_node_has_nothing_to_stop) {
  StudioCoordinator coordinator = begin(wire::CommandVerb::kStop);
  sent(coordinator);
  reply(coordinator, "cap01", Outcome::kRefused, "not armed");
  EXPECT_EQ(sent(coordinator), "stop@cap02,recon01");
  all_reply(coordinator, Outcome::kDone);
  EXPECT_TRUE(coordinator.is_finished());
  EXPECT_FALSE(coordinator.answer().done());
}

TEST_F(CoordinatorTest, finishes_with_the_reply_of_a_single_node) {
  const CommandTargets one = {{"cap01"}, "cap01"};
  for (const wire::CommandVerb verb : {wire::CommandVerb::kStop, wire::CommandVerb::kAbort}) {
    for (const Outcome outcome : {Outcome::kDone, Outcome::kRefused}) {
      StudioCoordinator coordinator = begin(verb, "", one);
      EXPECT_NE(sent(coordinator), "");
      reply(coordinator, "cap01", outcome);
      EXPECT_TRUE(coordinator.is_finished()) << name(verb);
      EXPECT_EQ(coordinator.answer().done(), outcome == Outcome::kDone);
      EXPECT_THAT(coordinator.answer().silent, IsEmpty());
    }
  }
  StudioCoordinator arm = begin(wire::CommandVerb::kArm, "kendo-07", one);
  EXPECT_EQ(sent(arm), "arm@cap01");
  reply(arm, "cap01", Outcome::kDone);
  EXPECT_EQ(sent(arm), "commit@cap01");
  reply(arm, "cap01", Outcome::kDone);
  EXPECT_TRUE(arm.answer().done() && arm.is_finished());
  StudioCoordinator drains = begin(wire::CommandVerb::kStop, "", one);
  sent(drains);
  reply(drains, "cap01", Outcome::kPending);
  EXPECT_FALSE(drains.is_finished());
  sent(drains);
  reply(drains, "cap01", Outcome::kDone);
  EXPECT_TRUE(drains.is_finished());
}

TEST_F(CoordinatorTest, learns_the_background_on_all_nodes_and_returns_each_result) {
  StudioCoordinator coordinator = begin(wire::CommandVerb::kBackground);
  sent(coordinator);
  reply(coordinator, "cap01", Outcome::kPending);
  for (const char* step : {"background@cap01,cap02,recon01", "commit@cap01,cap02,recon01",
                           "start@cap02,recon01", "start@cap01", "stop@cap01,cap02,recon01"}) {
    EXPECT_EQ(sent(coordinator), step);
    if (!coordinator.is_finished() && last_->verb != wire::CommandVerb::kStop)
      all_reply(coordinator, Outcome::kDone);
  }
  reply(coordinator, "cap01", Outcome::kDone, "learnt the background of 7 cameras");
  reply(coordinator, "recon01", Outcome::kDone, "nothing to learn here");
  reply(coordinator, "cap02", Outcome::kRefused, "cam09: only 3 of 16 plates arrived");
  EXPECT_FALSE(coordinator.answer().done());
  EXPECT_EQ(coordinator.answer().replies.at("cap01").text, "learnt the background of 7 cameras");
  EXPECT_EQ(coordinator.answer().replies.at("cap02").outcome, Outcome::kRefused);
}

TEST_F(CoordinatorTest, ignores_replies_to_other_commands_and_of_other_nodes) {
  StudioCoordinator coordinator = begin(wire::CommandVerb::kAbort);
  sent(coordinator);
  wire::ReplyMessage reply;
  reply.node = "cap01";
  reply.command_counter = last_->counter + 1;
  reply.outcome = Outcome::kDone;
  EXPECT_FALSE(coordinator.on_reply(reply));
  reply.command_counter = last_->counter;
  reply.node = "cap09";
  EXPECT_FALSE(coordinator.on_reply(reply));
}

TEST_F(CoordinatorTest, learns_a_nonce_only_from_the_reply_to_its_newest_command) {
  StudioCoordinator coordinator = begin(wire::CommandVerb::kAbort);
  sent(coordinator);
  wire::ReplyMessage newer;
  newer.node = "cap01";
  newer.command_sent = from_ns<Realtime>(2'000);
  newer.nonce = 22;
  newer.outcome = Outcome::kNonceMissing;
  wire::ReplyMessage replayed = newer;
  replayed.command_sent = from_ns<Realtime>(1'000);
  replayed.nonce = 11;
  coordinator.on_reply(newer);
  ASSERT_EQ(sent(coordinator), "abort@cap01") << "sent again at once, with the nonce";
  EXPECT_EQ(last_->nonces.front(), 22);
  coordinator.on_reply(replayed);
  EXPECT_EQ(sent(coordinator), "") << "an old reply sends nothing";
  now_ += StudioCoordinator::kRepeatAfter;
  ASSERT_NE(sent(coordinator), "");
  EXPECT_EQ(last_->nonces.front(), 22);
}

// --- simulated studios on unreliable networks ---------------------------------------------------

NetworkConditions any_conditions() {
  return {.loss = *rc::gen::inRange(0, 31) / 100.0,
          .repeat = *rc::gen::inRange(0, 31) / 100.0,
          .late = *rc::gen::inRange(0, 11) / 100.0};
}

uint32_t any_seed() { return *rc::gen::arbitrary<uint32_t>(); }

void add_take_orders(SimulatedOperator& person, const std::string& take) {
  person.add_order(wire::CommandVerb::kArm, take);
  person.add_order(wire::CommandVerb::kStart);
  person.add_order(wire::CommandVerb::kStop);
}

std::string text_of(const Answer& answer) {
  std::string text;
  for (const auto& [node, reply] : answer.replies) text += node + ": " + reply.text + "; ";
  for (const std::string& node : answer.silent) text += node + ": silent; ";
  return text;
}

RC_GTEST_PROP(Studio, records_every_take_on_every_node_on_any_network, ()) {
  SimulatedStudio studio(any_seed(), any_conditions(), 5);
  SimulatedOperator& anna = studio.add_operator("anna", 0s);
  anna.add_order(wire::CommandVerb::kBackground);
  add_take_orders(anna, "kendo-01");
  add_take_orders(anna, "kendo-02");
  studio.run_until_idle();
  for (const Answer& answer : anna.answers) RC_ASSERT(answer.done());
  RC_ASSERT(anna.answers.size() == 7U);
  RC_ASSERT(studio.takes == (std::vector<std::string>{"background", "kendo-01", "kendo-02"}));
  RC_ASSERT(studio.pulses_only_where_all_record);
  RC_ASSERT(studio.all_are(Phase::kIdle));
}

RC_GTEST_PROP(Studio, arms_the_take_of_one_operator_and_refuses_the_other, ()) {
  SimulatedStudio studio(any_seed(), any_conditions(), 4);
  SimulatedOperator& anna = studio.add_operator("anna", 0s);
  SimulatedOperator& ben =
      studio.add_operator("ben", std::chrono::milliseconds(*rc::gen::inRange(0, 30)));
  anna.add_order(wire::CommandVerb::kArm, "kendo-a");
  ben.add_order(wire::CommandVerb::kArm, "kendo-b");
  studio.run_until_idle();
  RC_ASSERT(anna.answers.size() == 1U && ben.answers.size() == 1U);
  const bool anna_has_it = anna.answers[0].done();
  const Answer& loser = anna_has_it ? ben.answers[0] : anna.answers[0];
  const std::string winner = anna_has_it ? "kendo-a by anna" : "kendo-b by ben";
  RC_LOG() << text_of(anna.answers[0]) << " / " << text_of(ben.answers[0]);
  RC_ASSERT(anna_has_it != ben.answers[0].done());
  RC_ASSERT(loser.silent.empty());
  RC_ASSERT(loser.replies.size() == 1U);
  RC_ASSERT(text_of(loser).find("armed for " + winner) != std::string::npos);
  RC_ASSERT(studio.all_are(Phase::kArmed));
}

/// Any orders of several operators at the same time.
RC_GTEST_PROP(Studio, reaches_one_state_for_any_concurrent_orders, ()) {
  SimulatedStudio studio(any_seed(), any_conditions(), 4);
  const int people = *rc::gen::inRange(2, 5);
  for (int i = 0; i < people; ++i) {
    const auto start = std::chrono::milliseconds(*rc::gen::inRange(0, 6000));
    SimulatedOperator& person = studio.add_operator("person" + std::to_string(i), start);
    switch (*rc::gen::inRange(0, 4)) {
      case 0:
        person.add_order(wire::CommandVerb::kStop);
        break;
      case 1:
        person.add_order(wire::CommandVerb::kAbort);
        break;
      case 2:
        person.add_order(wire::CommandVerb::kStart);
        break;
      default:
        add_take_orders(person, "kendo-" + std::to_string(i));
    }
  }
  studio.run_until_idle();
  for (const auto& person : studio.operators) {
    for (const Answer& answer : person->answers) RC_LOG() << text_of(answer) << "\n";
  }
  for (const auto& node : studio.nodes)
    RC_LOG() << int(node->phase()) << " " << node->take() << "\n";
  RC_ASSERT(studio.pulses_only_where_all_record);
  // Only a take that was started and not stopped may still run, and then on all nodes.
  RC_ASSERT(studio.all_are(Phase::kIdle) || studio.all_are(Phase::kRecording) ||
            studio.all_are(Phase::kArmed));
}

/// Nodes restart at any time; a final abort makes all of them idle.
RC_GTEST_PROP(Studio, reaches_one_state_after_restarts_of_nodes, ()) {
  SimulatedStudio studio(any_seed(), any_conditions(), 4);
  add_take_orders(studio.add_operator("anna", 0s), "kendo-01");
  add_take_orders(studio.add_operator("ben", 3s), "kendo-02");
  for (int i = *rc::gen::inRange(1, 4); i > 0; --i) {
    studio.run_for(std::chrono::milliseconds(*rc::gen::inRange(0, 2500)));
    studio.nodes[static_cast<size_t>(*rc::gen::inRange(0, 4))]->restart(studio.now());
  }
  studio.run_until_idle();
  SimulatedOperator& cleaner = studio.add_operator("cleaner", 0s);
  cleaner.add_order(wire::CommandVerb::kAbort);
  studio.run_until_idle();
  RC_ASSERT(cleaner.answers.size() == 1U && cleaner.answers[0].done());
  RC_ASSERT(studio.all_are(Phase::kIdle));
}

/// Any node except the trigger's.
test::SimulatedNode& any_other_node(SimulatedStudio& studio) {
  return *studio.nodes[static_cast<size_t>(*rc::gen::inRange(1, 4))];
}

RC_GTEST_PROP(Studio, rejoins_the_take_after_a_restart, ()) {
  SimulatedStudio studio(any_seed(), any_conditions(), 4);
  SimulatedOperator& anna = studio.add_operator("anna", 0s);
  anna.add_order(wire::CommandVerb::kArm, "kendo-01");
  anna.add_order(wire::CommandVerb::kStart);
  studio.run_until_idle();
  RC_ASSERT(studio.all_are(Phase::kRecording));
  for (int i = *rc::gen::inRange(1, 4); i > 0; --i) any_other_node(studio).restart(studio.now());
  studio.run_for(2s);
  RC_ASSERT(studio.all_are(Phase::kRecording));
  SimulatedOperator& ben = studio.add_operator("ben", 0s);
  ben.add_order(wire::CommandVerb::kStop);
  studio.run_until_idle();
  RC_ASSERT(ben.answers.at(0).done());
  RC_ASSERT(studio.all_are(Phase::kIdle));
}

/// The restart happens shortly before, during or after a stop of the take, or with that of the
/// trigger's node.
RC_GTEST_PROP(Studio, replies_the_ledger_after_a_restart_at_any_time, ()) {
  SimulatedStudio studio(any_seed(), any_conditions(), 4);
  SimulatedOperator& anna = studio.add_operator("anna", 0s);
  anna.add_order(wire::CommandVerb::kArm, "kendo-01");
  anna.add_order(wire::CommandVerb::kStart);
  studio.run_until_idle();
  SimulatedOperator& ben = studio.add_operator("ben", 1500ms);
  ben.add_order(wire::CommandVerb::kStop, "kendo-01");
  studio.run_for(std::chrono::milliseconds(*rc::gen::inRange(0, 4000)));
  any_other_node(studio).restart(studio.now());
  if (*rc::gen::inRange(0, 4) == 0) studio.nodes[0]->restart(studio.now());
  studio.run_until_idle();
  RC_LOG() << text_of(ben.answers.at(0));
  RC_ASSERT(ben.answers.at(0).done());
  RC_ASSERT(studio.all_are(Phase::kIdle));
}

}  // namespace
}  // namespace v3d::control
