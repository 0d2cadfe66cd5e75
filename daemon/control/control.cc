#include "daemon/control/control.h"

#include <algorithm>
#include <array>

namespace v3d {
namespace {

using Table = std::array<std::array<Transition, kInputCount>, kPhaseCount>;

/// Out of place: commands are refused, reports come late and change nothing.
constexpr Transition out_of_place(Phase phase, Input input) {
  return {phase, Work::kNone, is_command(input) ? Verdict::kRefused : Verdict::kNone};
}

/// Every phase and input.
consteval Table whole_table() {
  Table table{};
  for (int phase = 0; phase < kPhaseCount; ++phase) {
    for (int input = 0; input < kInputCount; ++input) {
      table[static_cast<size_t>(phase)][static_cast<size_t>(input)] =
          out_of_place(static_cast<Phase>(phase), static_cast<Input>(input));
    }
  }
  for (const TransitionRow& row : kTransitionTable) {
    table[static_cast<size_t>(row.phase)][static_cast<size_t>(row.input)] = row.transition;
  }
  return table;
}

/// "anna@desk" of "anna@desk/4711/1763..."
std::string person(const std::string& sender) { return sender.substr(0, sender.find('/')); }

/// Why a command is out of place, and what would be right.
std::string refusal(Phase phase, const CommandMessage& order) {
  const std::string armed = order.take + " by " + person(order.sender);
  switch (phase) {
    case Phase::kIdle:
      return "not armed; v3dctl arm TAKE comes first";
    case Phase::kArming:
    case Phase::kPrepared:
      return "just being armed for " + armed + "; wait, or v3dctl abort";
    case Phase::kArmed:
      return "armed for " + armed + " already; v3dctl start or abort";
    case Phase::kRecording:
      return "recording " + order.take + " already; v3dctl stop ends it";
    case Phase::kDraining:
      return "still closing " + order.take + "; wait for it";
    case Phase::kLearning:
      return "learning the background; wait, or v3dctl abort";
    case Phase::kFault:
      break;
  }
  return "fault";
}

std::string done_text(CommandVerb verb, Phase before, const std::string& take) {
  if (verb == CommandVerb::kStart) return "recording " + take;
  if (verb == CommandVerb::kCommit) return "armed for " + take;
  if (before == Phase::kIdle) return "nothing to abort";
  if (before == Phase::kFault) return "fault cleared";
  return verb == CommandVerb::kStop ? "nothing was recorded" : "aborted";
}

}  // namespace

NodeState node_state(Phase phase) {
  switch (phase) {
    case Phase::kIdle:
    case Phase::kArming:
    case Phase::kPrepared:
      return NodeState::kIdle;
    case Phase::kArmed:
      return NodeState::kArmed;
    case Phase::kRecording:
    case Phase::kLearning:
      return NodeState::kRecording;
    case Phase::kDraining:
      return NodeState::kDraining;
    case Phase::kFault:
      return NodeState::kFault;
  }
  return NodeState::kFault;
}

Input input_of(CommandVerb verb) {
  switch (verb) {
    case CommandVerb::kArm:
      return Input::kArm;
    case CommandVerb::kStart:
      return Input::kStart;
    case CommandVerb::kStop:
      return Input::kStop;
    case CommandVerb::kAbort:
      return Input::kAbort;
    case CommandVerb::kBackground:
      return Input::kBackground;
    case CommandVerb::kCommit:
      return Input::kCommit;
    case CommandVerb::kCheck:
      return Input::kCheck;
  }
  return Input::kAbort;
}

Transition transition(Phase phase, Input input) {
  static constexpr Table kTable = whole_table();
  return kTable[static_cast<size_t>(phase)][static_cast<size_t>(input)];
}

Controller::Heard& Controller::heard_from(const std::string& sender) {
  const auto known = std::find_if(heard_.begin(), heard_.end(),
                                  [&](const auto& entry) { return entry.first == sender; });
  std::pair<std::string, Heard> entry{sender, {}};
  if (known != heard_.end()) {
    entry = std::move(*known);
    heard_.erase(known);
  } else if (heard_.size() == kMaxSenders) {
    heard_.pop_back();
  }
  heard_.push_front(std::move(entry));
  return heard_.front().second;
}

ReplyMessage Controller::reply_to(const CommandMessage& command, ReplyMessage::Outcome outcome,
                                  std::string text, std::string detail) const {
  return {.sent = {},
          .node = node_,
          .command_sender = command.sender,
          .command_counter = command.counter,
          .command_sent = command.sent,
          .outcome = outcome,
          .take = phase_ == Phase::kIdle ? last_take_ : order_.take,
          .text = std::move(text),
          .detail = std::move(detail)};
}

/// A train of known length ends by itself: a stop that comes later gets the account all the same.
bool Controller::asks_for_last(const CommandMessage& command) const {
  return command.verb == CommandVerb::kStop && phase_ == Phase::kIdle && !last_take_.empty() &&
         (command.take.empty() ? !last_was_check_ : command.take == last_take_);
}

std::string Controller::misses(const CommandMessage& command) const {
  const bool orders = is_order(command.verb);
  if (orders || phase_ == Phase::kIdle || phase_ == Phase::kFault) return "";
  if (!command.take.empty() && command.take != order_.take) {
    return "the take here is " + order_.take + ", not " + command.take;
  }
  const bool commits = command.verb == CommandVerb::kCommit;
  if (!commits && !command.own_only) return "";
  // What was armed by one and could not be started by another goes too.
  if (command.own_only && phase_ == Phase::kArmed) return "";
  const bool started = phase_ > Phase::kArmed;
  const std::string& owner = started ? started_by_.sender : order_.sender;
  return command.sender == owner ? "" : refusal(phase_, order_);
}

ReplyMessage Controller::judge(const CommandMessage& command, const Transition& step) {
  using Outcome = ReplyMessage::Outcome;
  switch (step.verdict) {
    case Verdict::kPending:
      return reply_to(command, Outcome::kPending, "working on it");
    case Verdict::kDone:
      return reply_to(command, Outcome::kDone, done_text(command.verb, phase_, order_.take));
    default:
      break;
  }
  return reply_to(command, Outcome::kRefused,
                  phase_ == Phase::kFault ? fault_ : refusal(phase_, order_));
}

/// Returns what is answered; `step` gets what else there is to do and to say.
ReplyMessage Controller::carry_out(const CommandMessage& command, Step& step) {
  using Outcome = ReplyMessage::Outcome;
  if (asks_for_last(command)) {
    return reply_to(command, last_end_.outcome, last_end_.text, last_end_.detail);
  }
  if (const std::string why = misses(command); !why.empty()) {
    return reply_to(command, Outcome::kRefused, why);
  }
  const bool learns =
      command.verb == CommandVerb::kStart && order_.verb == CommandVerb::kBackground;
  const Transition next = transition(phase_, learns ? Input::kLearn : input_of(command.verb));
  ReplyMessage reply = judge(command, next);
  step.work = next.work;
  if (next.work == Work::kArm || next.work == Work::kLearn) {
    order_ = command;
    // Should this take end without an account, a stop must not get that of the one before.
    last_take_.clear();
  }
  if (next.work == Work::kStart) started_by_ = command;
  phase_ = next.next;
  if (next.verdict == Verdict::kDone && command.verb == CommandVerb::kAbort) {
    finish_waiting(Outcome::kRefused, "aborted", {}, step);
    fault_.clear();
  }
  if (next.verdict == Verdict::kPending) waiting_.push_back(command);
  return reply;
}

Controller::Step Controller::on_command(const CommandMessage& command) {
  Heard& heard = heard_from(command.sender);
  if (command.counter == heard.counter) {
    heard.reply.command_sent = command.sent;  // of this repetition
    return {.work = Work::kNone, .replies = {heard.reply}};
  }
  if (command.counter < heard.counter) return {};
  Step step;
  const ReplyMessage reply = carry_out(command, step);
  heard_from(command.sender) = {.counter = command.counter, .reply = reply};
  step.replies.insert(step.replies.begin(), reply);
  return step;
}

Controller::Step Controller::on_event(Input event, const std::string& text,
                                      const std::string& detail) {
  using Outcome = ReplyMessage::Outcome;
  const Transition next = transition(phase_, event);
  const Outcome outcome = event == Input::kFailed ? Outcome::kRefused : Outcome::kDone;
  Step step{.work = next.work, .replies = {}};
  if (event == Input::kBroken) {
    fault_ = text;
    finish_waiting(Outcome::kRefused, text, detail, step);
  } else if (next.next != phase_ && event != Input::kTrainEnded) {
    finish_waiting(outcome, text, detail, step);
  }
  const bool came_to_its_end = phase_ == Phase::kDraining || phase_ == Phase::kLearning;
  if (came_to_its_end && next.next == Phase::kIdle) {
    remember(order_.take, text, detail);
    last_end_.outcome = outcome;
    last_was_check_ = order_.verb == CommandVerb::kCheck;
  }
  phase_ = next.next;
  return step;
}

void Controller::remember(const std::string& take, const std::string& text,
                          const std::string& detail) {
  last_take_ = take;
  last_end_.outcome = ReplyMessage::Outcome::kDone;
  last_end_.text = text;
  last_end_.detail = detail;
}

void Controller::rejoined(const CommandMessage& order) {
  const Transition next = transition(phase_, Input::kRejoined);
  if (next.next == phase_) return;
  order_ = started_by_ = order;
  last_take_.clear();  // what was recovered is no longer all
  phase_ = next.next;
}

Controller::Step Controller::on_start_failed(const std::string& text) {
  waiting_.push_back(started_by_);
  return on_event(Input::kBroken, text);
}

void Controller::finish_waiting(ReplyMessage::Outcome outcome, const std::string& text,
                                const std::string& detail, Step& step) {
  for (const CommandMessage& command : waiting_) {
    const ReplyMessage reply = reply_to(command, outcome, text, detail);
    Heard& heard = heard_from(command.sender);
    if (heard.counter <= command.counter) heard = {.counter = command.counter, .reply = reply};
    step.replies.push_back(reply);
  }
  waiting_.clear();
}

}  // namespace v3d
