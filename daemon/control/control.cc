#include "daemon/control/control.h"

#include <algorithm>
#include <array>

namespace v3d::control {
namespace {

using Table = std::array<std::array<Transition, kInputCount>, kPhaseCount>;

/// A pair without a row: commands are refused, reports are late and change nothing.
constexpr Transition default_transition(Phase phase, Input input) {
  return {phase, Work::kNone, is_command(input) ? Verdict::kRefused : Verdict::kNone};
}

/// The transitions of all phases and inputs.
consteval Table full_table() {
  Table table{};
  for (int phase = 0; phase < kPhaseCount; ++phase) {
    for (int input = 0; input < kInputCount; ++input) {
      table[static_cast<size_t>(phase)][static_cast<size_t>(input)] =
          default_transition(static_cast<Phase>(phase), static_cast<Input>(input));
    }
  }
  for (const TransitionRow& row : kTransitionTable) {
    table[static_cast<size_t>(row.phase)][static_cast<size_t>(row.input)] = row.transition;
  }
  return table;
}

/// The operator in a sender: "anna@desk" in "anna@desk/4711/1763..."
std::string operator_name(const std::string& sender) { return sender.substr(0, sender.find('/')); }

/// The reason for refusing a command in this phase, and the remedy.
std::string refusal(Phase phase, const wire::CommandMessage& order) {
  const std::string armed = order.take + " by " + operator_name(order.sender);
  switch (phase) {
    case Phase::kIdle:
      return "not armed; v3dctl arm TAKE comes first";
    case Phase::kArming:
    case Phase::kPrepared:
      return "being armed for " + armed + "; wait, or v3dctl abort";
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

std::string done_text(wire::CommandVerb verb, Phase before, const std::string& take) {
  if (verb == wire::CommandVerb::kStart) return "recording " + take;
  if (verb == wire::CommandVerb::kCommit) return "armed for " + take;
  if (before == Phase::kIdle) return "nothing to abort";
  if (before == Phase::kFault) return "fault cleared";
  return verb == wire::CommandVerb::kStop ? "nothing was recorded" : "aborted";
}

}  // namespace

wire::NodeState node_state(Phase phase) {
  switch (phase) {
    case Phase::kIdle:
    case Phase::kArming:
    case Phase::kPrepared:
      return wire::NodeState::kIdle;
    case Phase::kArmed:
      return wire::NodeState::kArmed;
    case Phase::kRecording:
    case Phase::kLearning:
      return wire::NodeState::kRecording;
    case Phase::kDraining:
      return wire::NodeState::kDraining;
    case Phase::kFault:
      return wire::NodeState::kFault;
  }
  return wire::NodeState::kFault;
}

Input input_of(wire::CommandVerb verb) {
  switch (verb) {
    case wire::CommandVerb::kArm:
      return Input::kArm;
    case wire::CommandVerb::kStart:
      return Input::kStart;
    case wire::CommandVerb::kStop:
      return Input::kStop;
    case wire::CommandVerb::kAbort:
      return Input::kAbort;
    case wire::CommandVerb::kBackground:
      return Input::kBackground;
    case wire::CommandVerb::kCommit:
      return Input::kCommit;
    case wire::CommandVerb::kCheck:
      return Input::kCheck;
  }
  return Input::kAbort;
}

Transition transition(Phase phase, Input input) {
  static constexpr Table kTable = full_table();
  return kTable[static_cast<size_t>(phase)][static_cast<size_t>(input)];
}

Controller::LastReply& Controller::last_reply_to(const std::string& sender) {
  const auto known = std::find_if(senders_.begin(), senders_.end(),
                                  [&](const auto& entry) { return entry.first == sender; });
  std::pair<std::string, LastReply> entry{sender, {}};
  if (known != senders_.end()) {
    entry = std::move(*known);
    senders_.erase(known);
  } else if (senders_.size() == kMaxSenders) {
    senders_.pop_back();
  }
  senders_.push_front(std::move(entry));
  return senders_.front().second;
}

wire::ReplyMessage Controller::reply_to(const wire::CommandMessage& command,
                                        wire::ReplyMessage::Outcome outcome, std::string text,
                                        std::string detail) const {
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

bool Controller::asks_for_last_take(const wire::CommandMessage& command) const {
  return command.verb == wire::CommandVerb::kStop && phase_ == Phase::kIdle &&
         !last_take_.empty() &&
         (command.take.empty() ? !last_was_check_ : command.take == last_take_);
}

std::string Controller::mismatch(const wire::CommandMessage& command) const {
  const bool orders = is_order(command.verb);
  if (orders || phase_ == Phase::kIdle || phase_ == Phase::kFault) return "";
  if (!command.take.empty() && command.take != order_.take) {
    return "the take here is " + order_.take + ", not " + command.take;
  }
  const bool commits = command.verb == wire::CommandVerb::kCommit;
  if (!commits && !command.own_only) return "";
  // An own_only abort also ends what is armed: another operator armed it, this one could not start
  // it.
  if (command.own_only && phase_ == Phase::kArmed) return "";
  const bool started = phase_ > Phase::kArmed;
  const std::string& owner = started ? start_command_.sender : order_.sender;
  return command.sender == owner ? "" : refusal(phase_, order_);
}

wire::ReplyMessage Controller::verdict_reply(const wire::CommandMessage& command,
                                             const Transition& step) {
  using Outcome = wire::ReplyMessage::Outcome;
  switch (step.verdict) {
    case Verdict::kPending:
      return reply_to(command, Outcome::kPending, "in progress");
    case Verdict::kDone:
      return reply_to(command, Outcome::kDone, done_text(command.verb, phase_, order_.take));
    default:
      break;
  }
  return reply_to(command, Outcome::kRefused,
                  phase_ == Phase::kFault ? fault_ : refusal(phase_, order_));
}

/// Returns the reply. Sets the work in `step`, and adds replies to other commands.
wire::ReplyMessage Controller::execute(const wire::CommandMessage& command, Step& step) {
  using Outcome = wire::ReplyMessage::Outcome;
  if (asks_for_last_take(command)) {
    has_sent_result_ = true;
    return reply_to(command, last_result_.outcome, last_result_.text, last_result_.detail);
  }
  if (const std::string why = mismatch(command); !why.empty()) {
    return reply_to(command, Outcome::kRefused, why);
  }
  const bool learns =
      command.verb == wire::CommandVerb::kStart && order_.verb == wire::CommandVerb::kBackground;
  const Transition next = transition(phase_, learns ? Input::kLearn : input_of(command.verb));
  wire::ReplyMessage reply = verdict_reply(command, next);
  step.work = next.work;
  if (next.work == Work::kArm || next.work == Work::kLearn) {
    order_ = command;
    // If this take ends without a ledger, a stop must not get that of the previous take.
    last_take_.clear();
  }
  if (next.work == Work::kStart) start_command_ = command;
  phase_ = next.next;
  if (next.verdict == Verdict::kDone && command.verb == wire::CommandVerb::kAbort) {
    finish_pending(Outcome::kRefused, "aborted", {}, step);
    fault_.clear();
  }
  if (next.verdict == Verdict::kPending) pending_.push_back(command);
  return reply;
}

Controller::Step Controller::on_command(const wire::CommandMessage& command) {
  LastReply& last = last_reply_to(command.sender);
  if (command.counter == last.counter) {
    last.reply.command_sent = command.sent;  // the repetition
    return {.work = Work::kNone, .replies = {last.reply}};
  }
  if (command.counter < last.counter) return {};
  Step step;
  const wire::ReplyMessage reply = execute(command, step);
  last_reply_to(command.sender) = {.counter = command.counter, .reply = reply};
  step.replies.insert(step.replies.begin(), reply);
  return step;
}

Controller::Step Controller::on_event(Input event, const std::string& text,
                                      const std::string& detail) {
  using Outcome = wire::ReplyMessage::Outcome;
  const Transition next = transition(phase_, event);
  const Outcome outcome = event == Input::kFailed ? Outcome::kRefused : Outcome::kDone;
  Step step{.work = next.work, .replies = {}};
  if (event == Input::kBroken) {
    fault_ = text;
    finish_pending(Outcome::kRefused, text, detail, step);
  } else if (next.next != phase_ && event != Input::kTrainEnded) {
    finish_pending(outcome, text, detail, step);
  }
  const bool was_completing = phase_ == Phase::kDraining || phase_ == Phase::kLearning;
  if (was_completing && next.next == Phase::kIdle) {
    set_last_result(order_.take, text, detail);
    last_result_.outcome = outcome;
    last_was_check_ = order_.verb == wire::CommandVerb::kCheck;
  }
  phase_ = next.next;
  return step;
}

void Controller::set_last_result(const std::string& take, const std::string& text,
                                 const std::string& detail) {
  last_take_ = take;
  last_result_.outcome = wire::ReplyMessage::Outcome::kDone;
  last_result_.text = text;
  last_result_.detail = detail;
}

void Controller::rejoined(const wire::CommandMessage& order) {
  if (!may_rejoin()) return;
  order_ = start_command_ = order;
  last_take_.clear();  // the recovered ledger is no longer complete
  phase_ = transition(phase_, Input::kRejoined).next;
}

Controller::Step Controller::on_start_failed(const std::string& text) {
  pending_.push_back(start_command_);
  return on_event(Input::kBroken, text);
}

void Controller::finish_pending(wire::ReplyMessage::Outcome outcome, const std::string& text,
                                const std::string& detail, Step& step) {
  for (const wire::CommandMessage& command : pending_) {
    const wire::ReplyMessage reply = reply_to(command, outcome, text, detail);
    LastReply& last = last_reply_to(command.sender);
    if (last.counter <= command.counter) last = {.counter = command.counter, .reply = reply};
    step.replies.push_back(reply);
  }
  pending_.clear();
}

std::string_view name(Phase phase) {
  constexpr std::array<std::string_view, kPhaseCount> kNames = {
      "idle", "arming", "prepared", "armed", "recording", "draining", "learning", "fault"};
  return kNames.at(static_cast<size_t>(phase));
}

std::string_view name(Input input) {
  constexpr std::array<std::string_view, kInputCount> kNames = {
      "arm",   "start",  "stop",    "abort",       "background", "commit", "learn",   "check",
      "ready", "failed", "expired", "train_ended", "drained",    "broken", "rejoined"};
  return kNames.at(static_cast<size_t>(input));
}

std::string_view name(Work work) {
  constexpr std::array<std::string_view, 6> kNames = {"-",     "arm",    "start",
                                                      "drain", "disarm", "learn"};
  return kNames.at(static_cast<size_t>(work));
}

std::string_view name(Verdict verdict) {
  constexpr std::array<std::string_view, 4> kNames = {"-", "done", "pending", "refused"};
  return kNames.at(static_cast<size_t>(verdict));
}

}  // namespace v3d::control
