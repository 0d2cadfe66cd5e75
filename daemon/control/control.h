// What a node does with commands: a pure state machine, and the book-keeping that makes commands
// idempotent. Which commands are believed at all is the CommandGate's business, and how an operator
// brings many nodes into one state is the Conversation's.
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

/// As kTransitionTable says. Total: every input has an answer in every phase. Pulses run only from
/// kArmed, by kStart or kLearn; every other way out of a phase with pulses turns them off (kDrain
/// or kDisarm).
Transition transition(Phase phase, Input input);

/// Carries commands through the machine. The same (sender, counter) is answered again and not
/// carried out again; a counter lower than the sender's last comes late and is passed over. One
/// thread.
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

  /// A take that this node recorded before it was started anew: `stop` is answered with its
  /// account.
  void remember(const std::string& take, const std::string& text, const std::string& detail);

  /// The node, idle until now, records again the take of this order, which it was in before it was
  /// started anew.
  void rejoined(const CommandMessage& order);

  /// Pulses could not be turned on: the start command that was answered "done" is refused after
  /// all, and the node has a fault.
  Step on_start_failed(const std::string& text);

  Phase phase() const { return phase_; }
  /// The arm, check or background command that is being carried out, or was last.
  const CommandMessage& order() const { return order_; }
  const std::string& fault() const { return fault_; }

 private:
  struct Heard {
    int64_t counter = -1;
    ReplyMessage reply;
  };
  Heard& heard_from(const std::string& sender);
  ReplyMessage reply_to(const CommandMessage& command, ReplyMessage::Outcome outcome,
                        std::string text, std::string detail = {}) const;
  ReplyMessage judge(const CommandMessage& command, const Transition& step);
  void finish_waiting(ReplyMessage::Outcome outcome, const std::string& text,
                      const std::string& detail, Step& step);

  ReplyMessage carry_out(const CommandMessage& command, Step& step);
  /// Why the command is not for what this node is at; empty when it may be.
  std::string misses(const CommandMessage& command) const;
  bool asks_for_last(const CommandMessage& command) const;

  /// As many as the gate remembers; the one heard longest ago is forgotten.
  static constexpr size_t kMaxSenders = 64;

  const std::string node_;
  Phase phase_ = Phase::kIdle;
  CommandMessage order_;
  std::string fault_;
  std::string last_take_;        ///< the last that came to its end
  ReplyMessage last_end_;        ///< what is said of it
  bool last_was_check_ = false;  ///< a stop that names no take does not ask for it
  std::deque<std::pair<std::string, Heard>> heard_;  ///< the last heard first
  std::vector<CommandMessage> waiting_;              ///< for their final reply
  CommandMessage started_by_;                        ///< the last start command
};

}  // namespace v3d
