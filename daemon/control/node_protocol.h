// The node's side of the control protocol without network, clock and threads: the state machine,
// what it makes the node's work do, and when it lets go, rejoins or reports. Time is an argument,
// so the daemons (node_loop.h) and the simulator (tests/simulation) run the same code.
#pragma once

#include <functional>
#include <optional>
#include <string>

#include "base/time.h"
#include "daemon/control/control.h"
#include "daemon/control/node_delegate.h"
#include "wire/messages.h"

namespace v3d {

/// One thread.
class NodeProtocol {
 public:
  /// The longest time between two calls of poll(), at work and when nothing goes on.
  static constexpr Duration kTurn = std::chrono::milliseconds(20);
  static constexpr Duration kIdleTurn = std::chrono::milliseconds(200);
  static constexpr Duration kHealthEvery = std::chrono::seconds(1);
  /// A node that is ready and not confirmed for so long lets go: whoever asked is gone, or would
  /// not wait for the slowest node either.
  static constexpr Duration kConfirmWithin = std::chrono::seconds(60);
  /// A node that is asked to end drains its take for at most so long.
  static constexpr Duration kLastDrain = std::chrono::seconds(5);

  /// Publishes a reply; the receiver of the call fills in the time.
  using Reply = std::function<void(ReplyMessage reply)>;

  /// `work` outlives the protocol; `now`: when the node begins.
  NodeProtocol(std::string node, NodeDelegate& work, Reply reply, MonotonicInstant now);

  /// A take that the node was at when it ended before (Controller::remember).
  void remember(const std::string& take, const std::string& text, const std::string& detail) {
    controller_.remember(take, text, detail);
  }

  /// A command that the CommandGate admitted.
  void on_command(const CommandMessage& command);
  /// What has happened since: to be called after each command, and at next_turn() at the latest.
  /// `believes`: the node has a studio key, so what it hears of a running take can be trusted.
  void poll(MonotonicInstant now, bool believes);
  MonotonicInstant next_turn(MonotonicInstant now) const;

  /// Once a second, and at once when the phase has changed: other nodes act upon it.
  bool is_health_due(MonotonicInstant now) const;
  /// Node, state, take, and what the work has to report. `program`, `version` and time are the
  /// caller's.
  HealthMessage health(MonotonicInstant now);

  /// The daemon is asked to end: a running take is drained. Poll until may_end().
  void begin_to_end(MonotonicInstant now);
  bool may_end(MonotonicInstant now) const;

  Phase phase() const { return controller_.phase(); }
  const CommandMessage& order() const { return controller_.order(); }

 private:
  std::optional<NodeReport> poll_work();
  std::optional<NodeReport> on_poll_error(const std::string& error);
  void carry_out(const Controller::Step& step);
  void begin(Work work);
  void publish(const std::vector<ReplyMessage>& replies) const;
  void let_go_what_nobody_confirms(MonotonicInstant now);
  void rejoin_running_take();

  const std::string node_;
  NodeDelegate& work_;
  const Reply reply_;
  Controller controller_;
  int64_t health_seq_ = 0;
  Phase told_phase_ = Phase::kIdle;  ///< by the last health message
  MonotonicInstant next_health_;
  MonotonicInstant ready_since_;  ///< prepared and not committed
  MonotonicInstant end_by_;
  std::string poll_error_;  ///< that was logged last
};

}  // namespace v3d
