#include "daemon/control/studio_coordinator.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

#include "daemon/simulated_crew.h"

namespace v3d {
namespace {

using namespace std::chrono_literals;
using test::SimulatedCrew;
using test::SimulatedOperator;
using test::Weather;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;
using Outcome = ReplyMessage::Outcome;

const Commanded kStudio = {{"cap01", "cap02", "recon01"}, "cap01"};

class Talk : public testing::Test {
 protected:
  StudioCoordinator begin(CommandVerb verb, const std::string& take = "",
                          const Commanded& studio = kStudio) {
    CommandMessage order;
    order.verb = verb;
    order.take = take;
    return {order, 0, studio, now_ + 10s};
  }
  /// What is sent now: "arm@cap01,cap02", or "" when nothing is due.
  std::string sent(StudioCoordinator& talk) {
    last_ = talk.poll(now_);
    if (!last_) return "";
    std::string text(name(last_->verb));
    for (size_t i = 0; i < last_->to.size(); ++i) text += (i > 0 ? "," : "@") + last_->to[i];
    return text;
  }
  void say(StudioCoordinator& talk, const std::string& node, Outcome outcome,
           const std::string& text = "") {
    ReplyMessage reply;
    reply.node = node;
    reply.command_counter = last_->counter;
    reply.outcome = outcome;
    reply.take = "kendo-07";
    reply.text = text;
    talk.hear(reply);
  }
  void all_say(StudioCoordinator& talk, Outcome outcome) {
    const std::vector<std::string> to = last_->to;
    for (const std::string& node : to) say(talk, node, outcome, "well");
  }

  MonotonicInstant now_ = from_ns<Monotonic>(1'000'000'000);
  std::optional<CommandMessage> last_;
};

TEST_F(Talk, arms_the_triggers_node_then_all_and_commits_when_every_node_is_ready) {
  StudioCoordinator talk = begin(CommandVerb::kArm, "kendo-07");
  EXPECT_EQ(sent(talk), "arm@cap01");
  say(talk, "cap01", Outcome::kPending);
  EXPECT_EQ(sent(talk), "arm@cap01,cap02,recon01");
  say(talk, "recon01", Outcome::kDone, "reconstructs at 10 mm");
  say(talk, "cap01", Outcome::kDone);
  EXPECT_EQ(sent(talk), "") << "not due again yet";
  now_ += StudioCoordinator::kRepeatAfter;
  EXPECT_EQ(sent(talk), "arm@cap02");
  say(talk, "cap02", Outcome::kDone);
  EXPECT_EQ(sent(talk), "commit@cap01,cap02,recon01");
  all_say(talk, Outcome::kDone);
  EXPECT_TRUE(talk.over());
  EXPECT_TRUE(talk.answer().done());
  EXPECT_EQ(talk.answer().replies.at("recon01").text, "reconstructs at 10 mm");
}

TEST_F(Talk, asks_nobody_else_when_the_triggers_node_belongs_to_another) {
  StudioCoordinator talk = begin(CommandVerb::kArm, "kendo-08");
  sent(talk);
  say(talk, "cap01", Outcome::kRefused, "armed for kendo-07 by anna@desk already");
  EXPECT_TRUE(talk.over()) << "nothing to take back";
  EXPECT_FALSE(talk.answer().done());
  EXPECT_EQ(talk.answer().replies.size(), 1U);
  EXPECT_THAT(talk.answer().silent, IsEmpty());
}

TEST_F(Talk, takes_back_what_was_armed_when_one_node_refuses) {
  StudioCoordinator talk = begin(CommandVerb::kArm, "kendo-07");
  sent(talk);
  say(talk, "cap01", Outcome::kDone);
  sent(talk);
  say(talk, "cap02", Outcome::kRefused, "cam07 is silent");
  say(talk, "recon01", Outcome::kDone);
  EXPECT_EQ(sent(talk), "abort@cap01,cap02,recon01");
  EXPECT_TRUE(last_->own_only);
  EXPECT_EQ(last_->take, "kendo-07");
  all_say(talk, Outcome::kDone);
  EXPECT_TRUE(talk.over());
  EXPECT_EQ(talk.answer().replies.at("cap02").text, "cam07 is silent");
}

TEST_F(Talk, names_a_silent_node_and_takes_the_rest_back_for_a_while) {
  StudioCoordinator talk = begin(CommandVerb::kArm, "kendo-07");
  sent(talk);
  say(talk, "cap01", Outcome::kDone);
  sent(talk);
  say(talk, "recon01", Outcome::kDone);
  now_ += 10s;
  EXPECT_EQ(sent(talk), "abort@cap01,cap02,recon01");
  now_ += StudioCoordinator::kTakeBackWithin;
  EXPECT_EQ(sent(talk), "");
  EXPECT_TRUE(talk.over());
  EXPECT_THAT(talk.answer().silent, ElementsAre("cap02"));
}

TEST_F(Talk, starts_the_triggers_node_last_and_for_the_take_that_the_others_are_at) {
  StudioCoordinator talk = begin(CommandVerb::kStart);
  EXPECT_EQ(sent(talk), "start@cap02,recon01");
  all_say(talk, Outcome::kDone);
  EXPECT_EQ(sent(talk), "start@cap01");
  EXPECT_EQ(last_->take, "kendo-07");
  all_say(talk, Outcome::kDone);
  EXPECT_TRUE(talk.over());
  EXPECT_EQ(talk.answer().replies.size(), 3U);
}

TEST_F(Talk, starts_no_pulses_when_one_node_is_not_armed) {
  StudioCoordinator talk = begin(CommandVerb::kStart);
  sent(talk);
  say(talk, "cap02", Outcome::kRefused, "not armed");
  say(talk, "recon01", Outcome::kDone);
  EXPECT_EQ(sent(talk), "abort@cap01");
  EXPECT_TRUE(last_->own_only);
  say(talk, "cap01", Outcome::kDone, "aborted");
  EXPECT_EQ(sent(talk), "abort@cap02,recon01");
  EXPECT_FALSE(last_->own_only);
  EXPECT_EQ(last_->take, "kendo-07");
}

TEST_F(Talk, takes_a_start_back_nowhere_while_the_triggers_node_is_silent) {
  StudioCoordinator talk = begin(CommandVerb::kStart);
  sent(talk);
  all_say(talk, Outcome::kDone);
  EXPECT_EQ(sent(talk), "start@cap01");
  now_ += 10s;
  for (int i = 0; i < 14; ++i) {
    EXPECT_EQ(sent(talk), "abort@cap01") << "pulses may run";
    now_ += StudioCoordinator::kRepeatAfter;
  }
  now_ += StudioCoordinator::kTakeBackWithin;
  EXPECT_EQ(sent(talk), "");
  EXPECT_TRUE(talk.over());
  EXPECT_THAT(talk.answer().silent, ElementsAre("cap01"));
}

TEST_F(Talk, leaves_a_running_take_alone_when_a_second_start_is_refused) {
  StudioCoordinator talk = begin(CommandVerb::kStart);
  sent(talk);
  say(talk, "cap02", Outcome::kRefused, "not armed");
  say(talk, "recon01", Outcome::kDone);
  sent(talk);
  say(talk, "cap01", Outcome::kRefused, "recording kendo-07 already");
  EXPECT_TRUE(talk.over());
}

TEST_F(Talk, stops_the_triggers_node_first_and_all_when_it_is_silent) {
  StudioCoordinator talk = begin(CommandVerb::kStop);
  EXPECT_EQ(sent(talk), "stop@cap01");
  now_ += StudioCoordinator::kTriggerFirst + 1ms;
  EXPECT_EQ(sent(talk), "stop@cap01,cap02,recon01");
}

TEST_F(Talk, stops_the_others_when_the_triggers_node_has_nothing_to_stop) {
  StudioCoordinator talk = begin(CommandVerb::kStop);
  sent(talk);
  say(talk, "cap01", Outcome::kRefused, "not armed");
  EXPECT_EQ(sent(talk), "stop@cap02,recon01");
  all_say(talk, Outcome::kDone);
  EXPECT_TRUE(talk.over());
  EXPECT_FALSE(talk.answer().done());
}

TEST_F(Talk, with_one_node_is_over_as_soon_as_it_has_said_what_it_has_to) {
  const Commanded one = {{"cap01"}, "cap01"};
  for (const CommandVerb verb : {CommandVerb::kStop, CommandVerb::kAbort}) {
    for (const Outcome outcome : {Outcome::kDone, Outcome::kRefused}) {
      StudioCoordinator talk = begin(verb, "", one);
      EXPECT_NE(sent(talk), "");
      say(talk, "cap01", outcome);
      EXPECT_TRUE(talk.over()) << name(verb);
      EXPECT_EQ(talk.answer().done(), outcome == Outcome::kDone);
      EXPECT_THAT(talk.answer().silent, IsEmpty());
    }
  }
  StudioCoordinator arm = begin(CommandVerb::kArm, "kendo-07", one);
  EXPECT_EQ(sent(arm), "arm@cap01");
  say(arm, "cap01", Outcome::kDone);
  EXPECT_EQ(sent(arm), "commit@cap01");
  say(arm, "cap01", Outcome::kDone);
  EXPECT_TRUE(arm.answer().done() && arm.over());
  StudioCoordinator drains = begin(CommandVerb::kStop, "", one);
  sent(drains);
  say(drains, "cap01", Outcome::kPending);
  EXPECT_FALSE(drains.over());
  sent(drains);
  say(drains, "cap01", Outcome::kDone);
  EXPECT_TRUE(drains.over());
}

TEST_F(Talk, learns_the_background_in_all_nodes_and_tells_the_result_of_each) {
  StudioCoordinator talk = begin(CommandVerb::kBackground);
  sent(talk);
  say(talk, "cap01", Outcome::kPending);
  for (const char* round : {"background@cap01,cap02,recon01", "commit@cap01,cap02,recon01",
                            "start@cap02,recon01", "start@cap01", "stop@cap01,cap02,recon01"}) {
    EXPECT_EQ(sent(talk), round);
    if (!talk.over() && last_->verb != CommandVerb::kStop) all_say(talk, Outcome::kDone);
  }
  say(talk, "cap01", Outcome::kDone, "learnt the background of 7 cameras");
  say(talk, "recon01", Outcome::kDone, "nothing to learn here");
  say(talk, "cap02", Outcome::kRefused, "cam09: only 3 of 16 plates arrived");
  EXPECT_FALSE(talk.answer().done());
  EXPECT_EQ(talk.answer().replies.at("cap01").text, "learnt the background of 7 cameras");
  EXPECT_EQ(talk.answer().replies.at("cap02").outcome, Outcome::kRefused);
}

TEST_F(Talk, is_not_misled_by_replies_to_other_commands_and_of_other_nodes) {
  StudioCoordinator talk = begin(CommandVerb::kAbort);
  sent(talk);
  ReplyMessage reply;
  reply.node = "cap01";
  reply.command_counter = last_->counter + 1;
  reply.outcome = Outcome::kDone;
  EXPECT_FALSE(talk.hear(reply));
  reply.command_counter = last_->counter;
  reply.node = "cap09";
  EXPECT_FALSE(talk.hear(reply));
}

TEST_F(Talk, learns_a_nonce_from_the_reply_to_its_newest_command_alone) {
  StudioCoordinator talk = begin(CommandVerb::kAbort);
  sent(talk);
  ReplyMessage newer;
  newer.node = "cap01";
  newer.command_sent = from_ns<Realtime>(2'000);
  newer.nonce = 22;
  newer.outcome = Outcome::kNonceMissing;
  ReplyMessage replayed = newer;
  replayed.command_sent = from_ns<Realtime>(1'000);
  replayed.nonce = 11;
  talk.hear(newer);
  ASSERT_EQ(sent(talk), "abort@cap01") << "sent again at once, with the nonce";
  EXPECT_EQ(last_->nonces.front(), 22);
  talk.hear(replayed);
  EXPECT_EQ(sent(talk), "") << "an old reply sends nothing";
  now_ += StudioCoordinator::kRepeatAfter;
  ASSERT_NE(sent(talk), "");
  EXPECT_EQ(last_->nonces.front(), 22);
}

// --- whole studios on bad networks --------------------------------------------------------------

Weather any_weather() {
  return {.loss = *rc::gen::inRange(0, 31) / 100.0,
          .repeat = *rc::gen::inRange(0, 31) / 100.0,
          .late = *rc::gen::inRange(0, 11) / 100.0};
}

uint32_t any_seed() { return *rc::gen::arbitrary<uint32_t>(); }

void will_take(SimulatedOperator& person, const std::string& take) {
  person.will_say(CommandVerb::kArm, take);
  person.will_say(CommandVerb::kStart);
  person.will_say(CommandVerb::kStop);
}

std::string text_of(const Answer& answer) {
  std::string text;
  for (const auto& [node, reply] : answer.replies) text += node + ": " + reply.text + "; ";
  for (const std::string& node : answer.silent) text += node + ": silent; ";
  return text;
}

RC_GTEST_PROP(Studio, takes_every_take_on_any_network_in_every_node, ()) {
  SimulatedCrew crew(any_seed(), any_weather(), 5);
  SimulatedOperator& anna = crew.add_operator("anna", 0s);
  anna.will_say(CommandVerb::kBackground);
  will_take(anna, "kendo-01");
  will_take(anna, "kendo-02");
  crew.play();
  for (const Answer& answer : anna.answers) RC_ASSERT(answer.done());
  RC_ASSERT(anna.answers.size() == 7U);
  RC_ASSERT(crew.takes == (std::vector<std::string>{"background", "kendo-01", "kendo-02"}));
  RC_ASSERT(crew.pulses_only_where_all_record);
  RC_ASSERT(crew.all_are(Phase::kIdle));
}

RC_GTEST_PROP(Studio, gives_two_operators_at_once_one_take_and_one_clear_refusal, ()) {
  SimulatedCrew crew(any_seed(), any_weather(), 4);
  SimulatedOperator& anna = crew.add_operator("anna", 0s);
  SimulatedOperator& ben =
      crew.add_operator("ben", std::chrono::milliseconds(*rc::gen::inRange(0, 30)));
  anna.will_say(CommandVerb::kArm, "kendo-a");
  ben.will_say(CommandVerb::kArm, "kendo-b");
  crew.play();
  RC_ASSERT(anna.answers.size() == 1U && ben.answers.size() == 1U);
  const bool anna_has_it = anna.answers[0].done();
  const Answer& loser = anna_has_it ? ben.answers[0] : anna.answers[0];
  const std::string winner = anna_has_it ? "kendo-a by anna" : "kendo-b by ben";
  RC_LOG() << text_of(anna.answers[0]) << " / " << text_of(ben.answers[0]);
  RC_ASSERT(anna_has_it != ben.answers[0].done());
  RC_ASSERT(loser.silent.empty());
  RC_ASSERT(loser.replies.size() == 1U);
  RC_ASSERT(text_of(loser).find("armed for " + winner) != std::string::npos);
  RC_ASSERT(crew.all_are(Phase::kArmed));
}

/// Whatever several people want at the same time.
RC_GTEST_PROP(Studio, ends_in_one_state_whatever_operators_say_at_once, ()) {
  SimulatedCrew crew(any_seed(), any_weather(), 4);
  const int people = *rc::gen::inRange(2, 5);
  for (int i = 0; i < people; ++i) {
    const auto begins = std::chrono::milliseconds(*rc::gen::inRange(0, 6000));
    SimulatedOperator& person = crew.add_operator("person" + std::to_string(i), begins);
    switch (*rc::gen::inRange(0, 4)) {
      case 0:
        person.will_say(CommandVerb::kStop);
        break;
      case 1:
        person.will_say(CommandVerb::kAbort);
        break;
      case 2:
        person.will_say(CommandVerb::kStart);
        break;
      default:
        will_take(person, "kendo-" + std::to_string(i));
    }
  }
  crew.play();
  for (const auto& person : crew.operators) {
    for (const Answer& answer : person->answers) RC_LOG() << text_of(answer) << "\n";
  }
  for (const auto& node : crew.nodes) RC_LOG() << int(node->phase()) << " " << node->take() << "\n";
  RC_ASSERT(crew.pulses_only_where_all_record);
  // Only a take that somebody started and nobody stopped may still be on, and then everywhere.
  RC_ASSERT(crew.all_are(Phase::kIdle) || crew.all_are(Phase::kRecording) ||
            crew.all_are(Phase::kArmed));
}

/// Nodes lose their memory at any time; an abort in the end finds them all.
RC_GTEST_PROP(Studio, finds_its_way_back_to_one_state_though_nodes_start_anew_in_the_middle, ()) {
  SimulatedCrew crew(any_seed(), any_weather(), 4);
  will_take(crew.add_operator("anna", 0s), "kendo-01");
  will_take(crew.add_operator("ben", 3s), "kendo-02");
  for (int i = *rc::gen::inRange(1, 4); i > 0; --i) {
    crew.play_for(std::chrono::milliseconds(*rc::gen::inRange(0, 2500)));
    crew.nodes[static_cast<size_t>(*rc::gen::inRange(0, 4))]->start_anew(crew.now());
  }
  crew.play();
  SimulatedOperator& cleaner = crew.add_operator("cleaner", 0s);
  cleaner.will_say(CommandVerb::kAbort);
  crew.play();
  RC_ASSERT(cleaner.answers.size() == 1U && cleaner.answers[0].done());
  RC_ASSERT(crew.all_are(Phase::kIdle));
}

/// Any node but the trigger's.
test::SimulatedNode& any_other_node(SimulatedCrew& crew) {
  return *crew.nodes[static_cast<size_t>(*rc::gen::inRange(1, 4))];
}

RC_GTEST_PROP(Studio, has_a_node_record_again_that_was_started_anew_in_a_take, ()) {
  SimulatedCrew crew(any_seed(), any_weather(), 4);
  SimulatedOperator& anna = crew.add_operator("anna", 0s);
  anna.will_say(CommandVerb::kArm, "kendo-01");
  anna.will_say(CommandVerb::kStart);
  crew.play();
  RC_ASSERT(crew.all_are(Phase::kRecording));
  for (int i = *rc::gen::inRange(1, 4); i > 0; --i) any_other_node(crew).start_anew(crew.now());
  crew.play_for(2s);
  RC_ASSERT(crew.all_are(Phase::kRecording));
  SimulatedOperator& ben = crew.add_operator("ben", 0s);
  ben.will_say(CommandVerb::kStop);
  crew.play();
  RC_ASSERT(ben.answers.at(0).done());
  RC_ASSERT(crew.all_are(Phase::kIdle));
}

/// Started anew shortly before, while or after somebody stops the take, or when its trigger's node
/// goes too.
RC_GTEST_PROP(Studio, answers_for_the_take_whenever_a_node_is_started_anew_in_it, ()) {
  SimulatedCrew crew(any_seed(), any_weather(), 4);
  SimulatedOperator& anna = crew.add_operator("anna", 0s);
  anna.will_say(CommandVerb::kArm, "kendo-01");
  anna.will_say(CommandVerb::kStart);
  crew.play();
  SimulatedOperator& ben = crew.add_operator("ben", 1500ms);
  ben.will_say(CommandVerb::kStop, "kendo-01");
  crew.play_for(std::chrono::milliseconds(*rc::gen::inRange(0, 4000)));
  any_other_node(crew).start_anew(crew.now());
  if (*rc::gen::inRange(0, 4) == 0) crew.nodes[0]->start_anew(crew.now());
  crew.play();
  RC_LOG() << text_of(ben.answers.at(0));
  RC_ASSERT(ben.answers.at(0).done());
  RC_ASSERT(crew.all_are(Phase::kIdle));
}

}  // namespace
}  // namespace v3d
