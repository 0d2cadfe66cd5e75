// The operator's side of the control protocol: brings all nodes of a studio into one state, over a
// network that loses, repeats and reorders messages. Pure: time is an argument.
#pragma once

#include <deque>
#include <map>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "base/core/time.h"
#include "wire/messages.h"

namespace v3d::control {

/// The replies of the nodes to one order.
struct Answer {
  std::map<std::string, wire::ReplyMessage> replies;  ///< the last one by node: final or pending
  std::vector<std::string> silent;                    ///< nodes that did not reply

  /// Every node replied "done".
  bool done() const;
};

/// Sets sender and time of an operator's messages. Nodes reject a message that is not later than
/// the last one of its sender, so the times ascend even when the clock is set back. One thread.
class CommandStamp {
 public:
  /// `sender`: unique for each process that sends.
  explicit CommandStamp(std::string sender) : sender_(std::move(sender)) {}
  void apply(wire::CommandMessage& message, RealtimeInstant now);
  const std::string& sender() const { return sender_; }

 private:
  std::string sender_;
  RealtimeInstant last_;
};

/// The nonce that the next command to a node must hold (ReplyMessage::nonce).
struct NodeNonce {
  int64_t value = 0;
  RealtimeInstant command_sent = RealtimeInstant::min();  ///< of the command whose reply held it
};
using NodeNonces = std::map<std::string, NodeNonce>;  ///< by node

/// The nodes that receive commands.
struct CommandTargets {
  std::vector<std::string> nodes;
  std::string trigger;  ///< the node with the trigger, one of `nodes`
};

/// Executes one order of an operator, in steps. Each step sends one command to some nodes, and
/// repeats it until they have replied. The trigger's node makes the pulses, so it decides between
/// operators: it is the first to arm, stop and abort, and the last to start.
///   arm, check:  arm the trigger's node; arm all, until all are ready; commit all
///   background:  as arm; start as below; stop all, which waits for the results
///   start:       start all other nodes; start the trigger's node
///   stop, abort: the trigger's node, for at most kTriggerTimeout; all nodes
/// A start or stop without a take name gets the name of the take that the first node starts or
/// stops. Its repetitions hold this name, so that they cannot reach the next take of another
/// operator. A node that has started another take counts as refusing.
/// When a node refuses or is silent, the order is taken back: what it armed or started is aborted.
/// A start is taken back on other nodes only when the trigger's node has replied that no pulses
/// run. One thread.
class StudioCoordinator {
 public:
  /// Time between repetitions of a message.
  static constexpr Duration kRepeatAfter = std::chrono::milliseconds(200);
  /// How long stop and abort wait for the trigger's node before they address all nodes.
  static constexpr Duration kTriggerTimeout = std::chrono::seconds(1);
  /// Time to take an order back, after the deadline.
  static constexpr Duration kTakeBackTimeout = std::chrono::seconds(3);

  /// `order`: verb, take and details. `counter` and `nonces`: those of the operator's previous
  /// coordinator.
  StudioCoordinator(wire::CommandMessage order, int64_t counter, CommandTargets targets,
                    MonotonicInstant deadline, NodeNonces nonces = {});

  /// The message to send at `now`; empty when none is due. The caller applies a CommandStamp.
  std::optional<wire::CommandMessage> poll(MonotonicInstant now);
  /// The time of the next poll().
  MonotonicInstant next_due() const { return next_due_; }
  /// Returns true if the reply brings a new outcome or text. The caller passes only replies to its
  /// own commands.
  bool on_reply(const wire::ReplyMessage& reply);

  bool is_finished() const { return steps_.empty(); }
  /// Valid when is_finished().
  const Answer& answer() const { return answer_; }
  /// The counter of the last command that was sent.
  int64_t counter() const { return counter_; }
  /// The nonces learnt so far.
  const NodeNonces& nonces() const { return nonces_; }

 private:
  struct Step {
    wire::CommandVerb verb{};
    std::vector<std::string> nodes;
    bool accepted_is_enough = false;  ///< a pending reply completes the step
    Duration timeout{};               ///< then the next step; zero: the deadline
  };
  void plan();
  void plan_start();
  std::vector<std::string> others() const;
  bool is_arming() const;
  void learn_nonce(const wire::ReplyMessage& reply);
  int64_t nonce_of(const std::string& node) const;
  bool has_replied(const std::string& node) const;
  bool have_all_replied() const;
  bool any_refused() const;
  void store_replies();
  void record_silent_nodes();
  void end_of_step();
  void next_step();
  void begin_command();
  void fail();
  void plan_take_back();
  void continue_take_back();
  void bind_take(const wire::ReplyMessage& reply);
  bool starts_another_take(const wire::ReplyMessage& reply) const;
  void adopt_take();

  wire::CommandMessage order_;
  int64_t counter_;
  const CommandTargets targets_;
  const MonotonicInstant deadline_;
  std::deque<Step> steps_;                             ///< the first is the current one
  std::map<std::string, wire::ReplyMessage> replies_;  ///< to the current command, by node
  bool taking_back_ = false;
  bool own_only_;
  std::optional<MonotonicInstant> step_began_;  ///< empty until its first poll()
  MonotonicInstant next_due_;
  NodeNonces nonces_;
  Answer answer_;
};

}  // namespace v3d::control
