// The transition table of a node's control state machine: the one source for the code (transition()
// in control.h), for docs/protocol.md and for the Spin model (tests/simulation/control.pml).
#pragma once

#include <cstdint>
#include <string_view>

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
inline constexpr int kPhaseCount = 8;

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
  kExpired,     ///< prepared for too long without a commit
  kTrainEnded,  ///< the train had a known length and is over
  kDrained,     ///< everything is accounted for, and the take is closed
  kBroken,      ///< the node cannot go on
  kRejoined,    ///< after a restart the node records its take again
};
inline constexpr int kInputCount = 15;

/// True for what operators send, false for what the node's own work reports.
constexpr bool is_command(Input input) { return input <= Input::kCheck; }

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

struct TransitionRow {
  Phase phase;
  Input input;
  Transition transition;
};

/// Every pair that is not listed changes nothing: commands are refused, reports come late.
/// A stop ends what is armed, too: one operator may stop what another is just starting, node by
/// node, and all nodes must end in one state.
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

/// Words for the documentation, for traces and for the Spin model: "recording", "train_ended".
std::string_view name(Phase phase);
std::string_view name(Input input);
std::string_view name(Work work);
std::string_view name(Verdict verdict);

}  // namespace v3d
