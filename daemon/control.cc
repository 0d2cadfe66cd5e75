#include "daemon/control.h"

#include <algorithm>

namespace v3d {
namespace {

Transition stay(Phase phase, Verdict verdict) { return {phase, Work::kNone, verdict}; }

bool is_command(Input input) { return input <= Input::kBackground; }

/// Out of place: commands are refused, reports come late and change nothing.
Transition out_of_place(Phase phase, Input input) {
  return stay(phase, is_command(input) ? Verdict::kRefused : Verdict::kNone);
}

Transition from_idle(Input input) {
  switch (input) {
    case Input::kArm:
      return {Phase::kArming, Work::kArm, Verdict::kPending};
    case Input::kBackground:
      return {Phase::kLearning, Work::kLearn, Verdict::kPending};
    case Input::kAbort:
      return stay(Phase::kIdle, Verdict::kDone);
    default:
      return out_of_place(Phase::kIdle, input);
  }
}

/// Arming and learning: both end by themselves.
Transition from_preparing(Phase phase, Input input) {
  switch (input) {
    case Input::kReady:
      return phase == Phase::kArming ? stay(Phase::kArmed, Verdict::kNone)
                                     : Transition{Phase::kIdle, Work::kDisarm, Verdict::kNone};
    case Input::kFailed:
      return {Phase::kIdle, Work::kDisarm, Verdict::kNone};
    case Input::kAbort:
      return {Phase::kIdle, Work::kDisarm, Verdict::kDone};
    default:
      return out_of_place(phase, input);
  }
}

Transition from_armed(Input input) {
  switch (input) {
    case Input::kStart:
      return {Phase::kRecording, Work::kStart, Verdict::kDone};
    case Input::kAbort:
      return {Phase::kIdle, Work::kDisarm, Verdict::kDone};
    default:
      return out_of_place(Phase::kArmed, input);
  }
}

Transition from_recording(Input input) {
  switch (input) {
    case Input::kStop:
    case Input::kAbort:
      return {Phase::kDraining, Work::kDrain, Verdict::kPending};
    case Input::kTrainEnded:
      return {Phase::kDraining, Work::kDrain, Verdict::kNone};
    default:
      return out_of_place(Phase::kRecording, input);
  }
}

Transition from_draining(Input input) {
  switch (input) {
    case Input::kStop:
      return stay(Phase::kDraining, Verdict::kPending);
    case Input::kAbort:
      return {Phase::kIdle, Work::kDisarm, Verdict::kDone};
    case Input::kDrained:
      return {Phase::kIdle, Work::kDisarm, Verdict::kNone};
    default:
      return out_of_place(Phase::kDraining, input);
  }
}

Transition from_fault(Input input) {
  if (input == Input::kAbort) return {Phase::kIdle, Work::kDisarm, Verdict::kDone};
  return out_of_place(Phase::kFault, input);
}

/// Why `verb` is out of place, and what would be right.
std::string refusal(Phase phase, CommandVerb verb, const std::string& take) {
  switch (phase) {
    case Phase::kIdle:
      return "not armed; v3dctl arm TAKE comes first";
    case Phase::kArming:
      return "still making ready for " + take + "; wait, or v3dctl abort";
    case Phase::kArmed:
      return verb == CommandVerb::kStop ? "armed for " + take + ", but not recording"
                                        : "armed for " + take + " already; v3dctl start or abort";
    case Phase::kRecording:
      return "recording " + take + " already; v3dctl stop ends it";
    case Phase::kDraining:
      return "still closing " + take + "; wait for it";
    case Phase::kLearning:
      return "learning the background; wait, or v3dctl abort";
    case Phase::kFault:
      break;
  }
  return "fault";
}

std::string done_text(CommandVerb verb, Phase before, const std::string& take) {
  if (verb == CommandVerb::kStart) return "recording " + take;
  if (before == Phase::kIdle) return "nothing to abort";
  if (before == Phase::kFault) return "fault cleared";
  return "aborted";
}

}  // namespace

NodeState node_state(Phase phase) {
  switch (phase) {
    case Phase::kIdle:
    case Phase::kArming:
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
  }
  return Input::kAbort;
}

Transition transition(Phase phase, Input input) {
  if (input == Input::kBroken) {
    return {Phase::kFault,
            phase == Phase::kIdle || phase == Phase::kFault ? Work::kNone : Work::kDisarm,
            Verdict::kNone};
  }
  switch (phase) {
    case Phase::kIdle:
      return from_idle(input);
    case Phase::kArming:
    case Phase::kLearning:
      return from_preparing(phase, input);
    case Phase::kArmed:
      return from_armed(input);
    case Phase::kRecording:
      return from_recording(input);
    case Phase::kDraining:
      return from_draining(input);
    case Phase::kFault:
      return from_fault(input);
  }
  return out_of_place(phase, input);
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
          .outcome = outcome,
          .text = std::move(text),
          .detail = std::move(detail)};
}

ReplyMessage Controller::judge(const CommandMessage& command, const Transition& step) {
  using Outcome = ReplyMessage::Outcome;
  // A train of known length ends by itself: a stop that comes later gets the account all the same.
  const bool asks_for_last = command.verb == CommandVerb::kStop && phase_ == Phase::kIdle &&
                             !last_take_.empty() &&
                             (command.take.empty() || command.take == last_take_);
  if (asks_for_last) return reply_to(command, Outcome::kDone, last_text_, last_detail_);
  switch (step.verdict) {
    case Verdict::kPending:
      return reply_to(command, Outcome::kPending, "working on it");
    case Verdict::kDone:
      return reply_to(command, Outcome::kDone, done_text(command.verb, phase_, order_.take));
    default:
      break;
  }
  return reply_to(command, Outcome::kRefused,
                  phase_ == Phase::kFault ? fault_ : refusal(phase_, command.verb, order_.take));
}

Controller::Step Controller::on_command(const CommandMessage& command) {
  using Outcome = ReplyMessage::Outcome;
  Heard& heard = heard_from(command.sender);
  if (command.counter == heard.counter) return {.work = Work::kNone, .replies = {heard.reply}};
  if (command.counter < heard.counter) {
    return {.work = Work::kNone,
            .replies = {reply_to(command, Outcome::kRefused,
                                 "stale: a later command of this sender was heard")}};
  }
  heard.counter = command.counter;
  const bool of_another_take =
      (command.verb == CommandVerb::kStart || command.verb == CommandVerb::kStop) &&
      !command.take.empty() && phase_ != Phase::kIdle && command.take != order_.take;
  if (of_another_take) {
    heard.reply = reply_to(command, Outcome::kRefused,
                           "the take here is " + order_.take + ", not " + command.take);
    return {.work = Work::kNone, .replies = {heard.reply}};
  }
  const Transition next = transition(phase_, input_of(command.verb));
  heard.reply = judge(command, next);
  Step step{.work = next.work, .replies = {heard.reply}};
  if (next.work == Work::kArm || next.work == Work::kLearn) order_ = command;
  phase_ = next.next;
  if (next.verdict == Verdict::kDone && command.verb == CommandVerb::kAbort) {
    finish_waiting(Outcome::kRefused, "aborted", {}, step);
    fault_.clear();
  }
  if (next.work == Work::kStart) started_by_ = command;
  if (next.verdict == Verdict::kPending) waiting_.push_back(command);
  return step;
}

Controller::Step Controller::on_event(Input event, const std::string& text,
                                      const std::string& detail) {
  using Outcome = ReplyMessage::Outcome;
  const Transition next = transition(phase_, event);
  Step step{.work = next.work, .replies = {}};
  if (event == Input::kBroken) {
    fault_ = text;
    finish_waiting(Outcome::kRefused, text, detail, step);
  } else if (next.next != phase_ && event != Input::kTrainEnded) {
    finish_waiting(event == Input::kFailed ? Outcome::kRefused : Outcome::kDone, text, detail,
                   step);
  }
  if (event == Input::kDrained && phase_ == Phase::kDraining) {
    last_take_ = order_.take;
    last_text_ = text;
    last_detail_ = detail;
  }
  phase_ = next.next;
  return step;
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
