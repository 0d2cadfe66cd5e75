// The transition table of a node's control state machine. It is the source for the code
// (transition() in control.h), docs/protocol.md and the Spin model (tests/simulation/control.pml).
#pragma once

#include <cstdint>
#include <string_view>

namespace v3d {

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

}  // namespace v3d
