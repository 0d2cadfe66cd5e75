// State machine of a node and its transition table.
#pragma once

#include <cstdint>
#include <deque>
#include <map>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "wire/messages.h"

namespace v3d::control {

// The transition table of a node's control state machine. It is the source for the code
// (transition() in control.h), docs/protocol.md and the Spin model (tests/simulation/control.pml).

/// The phases of a node. Health shows the coarser NodeState.
enum class Phase : uint8_t {
  kIdle,
  kArming,     ///< cameras are being prepared
  kPrepared,   ///< ready, waits for the commit
  kArmed,      ///< committed: the next pulse is pulse 0
  kRecording,  ///< pulses run
  kDraining,   ///< pulses have stopped; frames are in flight
  kLearning,   ///< the background is being learnt
  kFault,      ///< an error that abort clears
};
inline constexpr int kPhaseCount = 8;

/// Inputs of the state machine: commands, and reports of the NodeDelegate.
enum class Input : uint8_t {
  kArm,
  kStart,
  kStop,
  kAbort,
  kBackground,
  kCommit,      ///< all nodes are ready
  kLearn,       ///< start, after kBackground
  kCheck,       ///< like kArm, but nothing will be recorded
  kReady,       ///< arming or learning has succeeded
  kFailed,      ///< arming or learning has failed
  kExpired,     ///< prepared for too long without a commit
  kTrainEnded,  ///< pulses have ended without a stop
  kDrained,     ///< the take is accounted for and closed
  kBroken,      ///< the node cannot continue
  kRejoined,    ///< after a restart, the node records into its take again
};
inline constexpr int kInputCount = 15;

/// True for commands, false for reports.
constexpr bool is_command(Input input) { return input <= Input::kCheck; }

/// The work that a transition requires of the NodeDelegate.
enum class Work : uint8_t {
  kNone,
  kArm,     ///< start to prepare
  kStart,   ///< start pulses
  kDrain,   ///< stop pulses, wait for frames in flight, close the take
  kDisarm,  ///< stop pulses and close the take at once
  kLearn,   ///< start to learn the background
};

/// The reply to a command; kNone for reports.
enum class Verdict : uint8_t { kNone, kDone, kPending, kRefused };

struct Transition {
  Phase next;
  Work work;
  Verdict verdict;
  friend bool operator==(const Transition&, const Transition&) = default;
};

struct TransitionRow {
  Phase phase;
  Input input;
  Transition transition;
};

/// A pair that is not listed changes nothing: commands are refused, reports are late and ignored.
/// A stop also disarms: one operator may stop a take that another is starting node by node, and all
/// nodes must reach the same state.
inline constexpr TransitionRow kTransitionTable[] = {
    {Phase::kIdle, Input::kArm, {Phase::kArming, Work::kArm, Verdict::kPending}},
    {Phase::kIdle, Input::kCheck, {Phase::kArming, Work::kArm, Verdict::kPending}},
    {Phase::kIdle, Input::kBackground, {Phase::kArming, Work::kLearn, Verdict::kPending}},
    {Phase::kIdle, Input::kAbort, {Phase::kIdle, Work::kNone, Verdict::kDone}},
    {Phase::kIdle, Input::kRejoined, {Phase::kRecording, Work::kNone, Verdict::kNone}},
    {Phase::kIdle, Input::kBroken, {Phase::kFault, Work::kNone, Verdict::kNone}},

    {Phase::kArming, Input::kReady, {Phase::kPrepared, Work::kNone, Verdict::kNone}},
    {Phase::kArming, Input::kFailed, {Phase::kIdle, Work::kDisarm, Verdict::kNone}},
    {Phase::kArming, Input::kAbort, {Phase::kIdle, Work::kDisarm, Verdict::kDone}},
    {Phase::kArming, Input::kBroken, {Phase::kFault, Work::kDisarm, Verdict::kNone}},

    {Phase::kPrepared, Input::kCommit, {Phase::kArmed, Work::kNone, Verdict::kDone}},
    {Phase::kPrepared, Input::kExpired, {Phase::kIdle, Work::kDisarm, Verdict::kNone}},
    {Phase::kPrepared, Input::kAbort, {Phase::kIdle, Work::kDisarm, Verdict::kDone}},
    {Phase::kPrepared, Input::kBroken, {Phase::kFault, Work::kDisarm, Verdict::kNone}},

    {Phase::kArmed, Input::kCommit, {Phase::kArmed, Work::kNone, Verdict::kDone}},
    {Phase::kArmed, Input::kStart, {Phase::kRecording, Work::kStart, Verdict::kDone}},
    {Phase::kArmed, Input::kLearn, {Phase::kLearning, Work::kStart, Verdict::kDone}},
    {Phase::kArmed, Input::kStop, {Phase::kIdle, Work::kDisarm, Verdict::kDone}},
    {Phase::kArmed, Input::kAbort, {Phase::kIdle, Work::kDisarm, Verdict::kDone}},
    {Phase::kArmed, Input::kBroken, {Phase::kFault, Work::kDisarm, Verdict::kNone}},

    {Phase::kRecording, Input::kStart, {Phase::kRecording, Work::kNone, Verdict::kDone}},
    {Phase::kRecording, Input::kStop, {Phase::kDraining, Work::kDrain, Verdict::kPending}},
    {Phase::kRecording, Input::kAbort, {Phase::kDraining, Work::kDrain, Verdict::kPending}},
    {Phase::kRecording, Input::kTrainEnded, {Phase::kDraining, Work::kDrain, Verdict::kNone}},
    {Phase::kRecording, Input::kBroken, {Phase::kFault, Work::kDisarm, Verdict::kNone}},

    {Phase::kDraining, Input::kStop, {Phase::kDraining, Work::kNone, Verdict::kPending}},
    {Phase::kDraining, Input::kAbort, {Phase::kIdle, Work::kDisarm, Verdict::kDone}},
    {Phase::kDraining, Input::kDrained, {Phase::kIdle, Work::kDisarm, Verdict::kNone}},
    {Phase::kDraining, Input::kBroken, {Phase::kFault, Work::kDisarm, Verdict::kNone}},

    {Phase::kLearning, Input::kLearn, {Phase::kLearning, Work::kNone, Verdict::kDone}},
    {Phase::kLearning, Input::kStop, {Phase::kLearning, Work::kNone, Verdict::kPending}},
    {Phase::kLearning, Input::kReady, {Phase::kIdle, Work::kDisarm, Verdict::kNone}},
    {Phase::kLearning, Input::kFailed, {Phase::kIdle, Work::kDisarm, Verdict::kNone}},
    {Phase::kLearning, Input::kAbort, {Phase::kIdle, Work::kDisarm, Verdict::kDone}},
    {Phase::kLearning, Input::kBroken, {Phase::kFault, Work::kDisarm, Verdict::kNone}},

    {Phase::kFault, Input::kAbort, {Phase::kIdle, Work::kDisarm, Verdict::kDone}},
    {Phase::kFault, Input::kBroken, {Phase::kFault, Work::kNone, Verdict::kNone}},
};

/// Names for documentation, traces and the Spin model: "recording", "train_ended".
std::string_view name(Phase phase);
std::string_view name(Input input);
std::string_view name(Work work);
std::string_view name(Verdict verdict);

// The control state machine of a node, and the record of replies that makes commands idempotent.
// Pure. CommandReplayFilter authenticates commands before; StudioCoordinator is the operator's
// side.

wire::NodeState node_state(Phase phase);

Input input_of(wire::CommandVerb verb);

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
    std::vector<wire::ReplyMessage> replies;  ///< to be published
  };
  Step on_command(const wire::CommandMessage& command);
  /// `text`: one line for the operator; `detail`: JSON of a final reply.
  Step on_event(Input event, const std::string& text, const std::string& detail = {});

  /// Sets the take that this node recorded before it restarted, and the reply to a later `stop`.
  void set_last_result(const std::string& take, const std::string& text, const std::string& detail);

  /// Enters kRecording: after a restart, the node records again into the take of this order.
  /// Requires may_rejoin(); otherwise nothing changes.
  void rejoined(const wire::CommandMessage& order);
  /// The node is idle and has answered no stop with the result of its last take: frames that were
  /// written after the answer would not be in it.
  bool may_rejoin() const { return phase_ == Phase::kIdle && !has_sent_result_; }

  /// Pulses could not be started. Enters kFault; the start command that was answered "done" gets
  /// the reply "refused".
  Step on_start_failed(const std::string& text);

  Phase phase() const { return phase_; }
  /// A train of known length ends by itself. A later stop still gets the ledger of that take.
  bool asks_for_last_take(const wire::CommandMessage& command) const;
  /// The last arm, check or background command.
  const wire::CommandMessage& order() const { return order_; }
  const std::string& fault() const { return fault_; }

 private:
  struct LastReply {
    int64_t counter = -1;
    wire::ReplyMessage reply;
  };
  LastReply& last_reply_to(const std::string& sender);
  wire::ReplyMessage reply_to(const wire::CommandMessage& command,
                              wire::ReplyMessage::Outcome outcome, std::string text,
                              std::string detail = {}) const;
  wire::ReplyMessage verdict_reply(const wire::CommandMessage& command, const Transition& step);
  void finish_pending(wire::ReplyMessage::Outcome outcome, const std::string& text,
                      const std::string& detail, Step& step);

  wire::ReplyMessage execute(const wire::CommandMessage& command, Step& step);
  /// Why the command does not apply to the take or owner of this node; empty if it applies.
  std::string mismatch(const wire::CommandMessage& command) const;

  /// Equals that of CommandReplayFilter. The least recent sender is removed first.
  static constexpr size_t kMaxSenders = 64;

  const std::string node_;
  Phase phase_ = Phase::kIdle;
  wire::CommandMessage order_;
  std::string fault_;
  std::string last_take_;           ///< the last completed one
  wire::ReplyMessage last_result_;  ///< the reply to a stop of last_take_
  bool last_was_check_ = false;     ///< a stop without a take name then gets no result
  bool has_sent_result_ = false;
  std::deque<std::pair<std::string, LastReply>> senders_;  ///< most recent first
  std::vector<wire::CommandMessage> pending_;              ///< commands without a final reply
  wire::CommandMessage start_command_;                     ///< the last one
};

}  // namespace v3d::control
