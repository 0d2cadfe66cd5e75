// A node's side of the protocol.
#pragma once

#include <functional>
#include <optional>
#include <string>

#include "base/core/time.h"
#include "daemon/control/control.h"
#include "wire/messages.h"
#include "wire/signatures.h"

namespace v3d::control {

// Interface of the work of a node: capture or reconstruction. NodeProtocol calls it.

struct NodeReport {
  Input event = Input::kBroken;  ///< kReady, kFailed, kTrainEnded, kDrained or kBroken
  std::string text;              ///< one line for the operator
  std::string detail;            ///< JSON, or empty
};

/// All functions are called by one thread. None blocks, except that disarm() waits for threads to
/// end. Exceptions of arm(), learn(), start(), drain() and poll() become a refusal or a fault.
class NodeDelegate {
 public:
  virtual ~NodeDelegate() = default;

  /// The key of `[storage] signing_key`, after it was read for the first time or replaced. A take
  /// that is armed keeps the previous key.
  virtual void set_signing_key(const wire::SigningKey& /*key*/) {}

  virtual void arm(const wire::CommandMessage& command) = 0;
  virtual void learn(const wire::CommandMessage& command) = 0;
  virtual void start() = 0;
  virtual void drain() = 0;
  /// Stops pulses and closes the take, in any phase. Idempotent.
  virtual void disarm() = 0;

  /// Called at every poll() of an idle node that may rejoin. If the take that the node recorded
  /// before a restart still runs, starts to record into it again and returns its order; otherwise,
  /// and while its logs are read, empty. Exceptions are logged, and the node stays idle.
  virtual std::optional<wire::CommandMessage> rejoin() { return std::nullopt; }

  /// The next report, if any. Called every NodeProtocol::kPollPeriod at work.
  virtual std::optional<NodeReport> poll(Phase phase) = 0;

  /// Sets `text` and `values` of `health`, and sends events that are due. Called once a second, and
  /// after each change of phase.
  virtual void report_health(wire::HealthMessage& health) = 0;
  /// Has every thread of the pipeline completed a loop after `since`? Feeds the watchdog.
  virtual bool progressed_since(MonotonicInstant since) const = 0;
};

// The control protocol of a node, without network, clock and threads: runs the Controller, calls
// the NodeDelegate, and decides about timeouts, rejoining and health messages. Time is an argument,
// so that the daemons (node_loop.h) and the simulator (tests/simulation) run the same code.

/// One thread.
class NodeProtocol {
 public:
  /// Longest time between two calls of poll(): at work, and when idle or in fault.
  static constexpr Duration kPollPeriod = std::chrono::milliseconds(20);
  static constexpr Duration kIdlePollPeriod = std::chrono::milliseconds(200);
  static constexpr Duration kHealthPeriod = std::chrono::seconds(1);
  /// A prepared node becomes idle after this time without a commit: its operator has failed, or
  /// some node was too slow.
  static constexpr Duration kCommitTimeout = std::chrono::seconds(60);
  /// Longest drain when the daemon shuts down.
  static constexpr Duration kShutdownDrain = std::chrono::seconds(5);

  /// Publishes a reply. The callee sets `sent`.
  using Reply = std::function<void(wire::ReplyMessage reply)>;

  /// `delegate` must outlive this object. `now`: the time of the first health message.
  NodeProtocol(std::string node, NodeDelegate& delegate, Reply reply, MonotonicInstant now);

  /// See Controller::set_last_result().
  void set_last_result(const std::string& take, const std::string& text,
                       const std::string& detail) {
    controller_.set_last_result(take, text, detail);
  }

  /// Executes a command that the CommandReplayFilter admitted.
  void on_command(const wire::CommandMessage& command);
  /// Handles reports of the delegate and timeouts. Call it after each command, and at next_poll().
  /// `has_key`: messages are verified, so that the node may rejoin a take that other nodes report.
  void poll(MonotonicInstant now, bool has_key);
  MonotonicInstant next_poll(MonotonicInstant now) const;

  /// Every kHealthPeriod, and at once after a change of phase, because other nodes react to it.
  bool is_health_due(MonotonicInstant now) const;
  /// The next health message. The caller sets `program`, `version` and `sent`.
  wire::HealthMessage health(MonotonicInstant now);

  /// Starts to drain a running take. Call poll() until may_shut_down().
  void begin_shutdown(MonotonicInstant now);
  bool may_shut_down(MonotonicInstant now) const;

  Phase phase() const { return controller_.phase(); }
  /// Whether the node has a take, or the result of the last one for this stop. Not for orders.
  bool has_take_of(const wire::CommandMessage& command) const {
    return phase() != Phase::kIdle || controller_.asks_for_last_take(command);
  }
  const wire::CommandMessage& order() const { return controller_.order(); }

 private:
  std::optional<NodeReport> poll_delegate();
  std::optional<NodeReport> on_poll_error(const std::string& error);
  void execute(const Controller::Step& step);
  void perform(Work work);
  void publish(const std::vector<wire::ReplyMessage>& replies) const;
  void expire_uncommitted(MonotonicInstant now);
  void rejoin_running_take();

  const std::string node_;
  NodeDelegate& delegate_;
  const Reply reply_;
  Controller controller_;
  int64_t health_seq_ = 0;
  Phase reported_phase_ = Phase::kIdle;  ///< in the last health message
  MonotonicInstant next_health_;
  MonotonicInstant prepared_since_;  ///< without a commit
  MonotonicInstant shutdown_deadline_;
  std::string poll_error_;  ///< last logged error of poll()
};

}  // namespace v3d::control
