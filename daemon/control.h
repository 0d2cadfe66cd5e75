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

#include "wire/messages.h"

namespace v3d {

/// Finer than NodeState, which is what health shows.
enum class Phase : uint8_t {
  kIdle,
  kArming,     ///< cameras are being made ready
  kPrepared,   ///< ready, and waits to hear that every node is
  kArmed,      ///< every node is ready: the next pulse is pulse 0
  kRecording,  ///< pulses run
  kDraining,   ///< pulses have stopped; frames are still on their way
  kLearning,   ///< the background is being learnt
  kFault,      ///< cannot work; abort clears it
};
NodeState node_state(Phase phase);

/// Commands, and what the node's own work reports.
enum class Input : uint8_t {
  kArm,
  kStart,
  kStop,
  kAbort,
  kBackground,
  kCommit,      ///< every node has said that it is ready
  kLearn,       ///< start, where the background is to be learnt
  kCheck,       ///< as kArm, and nothing is recorded
  kReady,       ///< arming or learning has succeeded
  kFailed,      ///< arming or learning has failed
  kExpired,     ///< ready for long, and nobody said that the others are
  kTrainEnded,  ///< the train had a known length and is over
  kDrained,     ///< everything is accounted for, and the take is closed
  kBroken,      ///< the node cannot go on
  kRejoined,    ///< started anew, it records again the take that it was in
};
Input input_of(CommandVerb verb);

/// What the node has to do now.
enum class Work : uint8_t {
  kNone,
  kArm,     ///< begin to make ready
  kStart,   ///< pulses on
  kDrain,   ///< pulses off, wait for what is on its way, close
  kDisarm,  ///< pulses off, close at once what is open, back to idle
  kLearn,   ///< begin to learn the background
};

/// The answer to the command that is the input; kNone for inputs that are no commands.
enum class Verdict : uint8_t { kNone, kDone, kPending, kRefused };

struct Transition {
  Phase next;
  Work work;
  Verdict verdict;
  friend bool operator==(const Transition&, const Transition&) = default;
};

/// Total: every input has an answer in every phase. Pulses run only from kArmed, by kStart or
/// kLearn; every other way out of a phase with pulses turns them off (kDrain or kDisarm).
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
