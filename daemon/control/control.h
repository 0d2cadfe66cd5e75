// The control state machine of a node, and the record of replies that makes commands idempotent.
// Pure. CommandReplayFilter authenticates commands before; StudioCoordinator is the operator's
// side.
#pragma once

#include <cstdint>
#include <deque>
#include <map>
#include <string>
#include <utility>
#include <vector>

#include "daemon/control/control_table.h"
#include "wire/messages.h"

namespace v3d {

NodeState node_state(Phase phase);

Input input_of(CommandVerb verb);

/// The transition by kTransitionTable. Defined for every phase and input. Pulses start only in
/// kArmed, by kStart or kLearn. Every transition out of a phase with pulses stops them (kDrain or
/// kDisarm).
Transition transition(Phase phase, Input input);

/// Executes commands. A repeated (sender, counter) gets the same reply and is not executed again. A
/// counter lower than the last one of its sender is late and ignored. One thread.
class Controller {
 public:
  explicit Controller(std::string node) : node_(std::move(node)) {}

  struct Step {
    Work work = Work::kNone;
    std::vector<ReplyMessage> replies;  ///< to be published
  };
  Step on_command(const CommandMessage& command);
  /// `text`: one line for the operator; `detail`: JSON of a final reply.
  Step on_event(Input event, const std::string& text, const std::string& detail = {});

  /// Sets the take that this node recorded before it restarted, and the reply to a later `stop`.
  void remember(const std::string& take, const std::string& text, const std::string& detail);

  /// Enters kRecording: after a restart, the node records again into the take of this order.
  /// Requires may_rejoin(); otherwise nothing changes.
  void rejoined(const CommandMessage& order);
  /// The node is idle and has answered no stop with the result of its last take: frames that were
  /// written after the answer would not be in it.
  bool may_rejoin() const { return phase_ == Phase::kIdle && !has_sent_result_; }

  /// Pulses could not be started. Enters kFault; the start command that was answered "done" gets
  /// the reply "refused".
  Step on_start_failed(const std::string& text);

  Phase phase() const { return phase_; }
  /// A train of known length ends by itself. A later stop still gets the ledger of that take.
  bool asks_for_last_take(const CommandMessage& command) const;
  /// The last arm, check or background command.
  const CommandMessage& order() const { return order_; }
  const std::string& fault() const { return fault_; }

 private:
  struct LastReply {
    int64_t counter = -1;
    ReplyMessage reply;
  };
  LastReply& last_reply_to(const std::string& sender);
  ReplyMessage reply_to(const CommandMessage& command, ReplyMessage::Outcome outcome,
                        std::string text, std::string detail = {}) const;
  ReplyMessage verdict_reply(const CommandMessage& command, const Transition& step);
  void finish_pending(ReplyMessage::Outcome outcome, const std::string& text,
                      const std::string& detail, Step& step);

  ReplyMessage execute(const CommandMessage& command, Step& step);
  /// Why the command does not apply to the take or owner of this node; empty if it applies.
  std::string mismatch(const CommandMessage& command) const;

  /// Equals that of CommandReplayFilter. The least recent sender is removed first.
  static constexpr size_t kMaxSenders = 64;

  const std::string node_;
  Phase phase_ = Phase::kIdle;
  CommandMessage order_;
  std::string fault_;
  std::string last_take_;        ///< the last completed one
  ReplyMessage last_result_;     ///< the reply to a stop of last_take_
  bool last_was_check_ = false;  ///< a stop without a take name then gets no result
  bool has_sent_result_ = false;
  std::deque<std::pair<std::string, LastReply>> senders_;  ///< most recent first
  std::vector<CommandMessage> pending_;                    ///< commands without a final reply
  CommandMessage start_command_;                           ///< the last one
};

}  // namespace v3d
