// Interface of the work of a node: capture or reconstruction. NodeProtocol calls it.
#pragma once

#include <optional>
#include <string>

#include "base/core/time.h"
#include "daemon/control/control.h"
#include "wire/messages.h"
#include "wire/signing_key.h"

namespace v3d {

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
  virtual void set_signing_key(const SigningKey& /*key*/) {}

  virtual void arm(const CommandMessage& command) = 0;
  virtual void learn(const CommandMessage& command) = 0;
  virtual void start() = 0;
  virtual void drain() = 0;
  /// Stops pulses and closes the take, in any phase. Idempotent.
  virtual void disarm() = 0;

  /// Called while the node is idle. If the take that the node recorded before a restart still runs,
  /// starts to record into it again and returns its order; otherwise empty. Exceptions are logged,
  /// and the node stays idle.
  virtual std::optional<CommandMessage> rejoin() { return std::nullopt; }

  /// The next report, if any. Called every NodeProtocol::kPollPeriod at work.
  virtual std::optional<NodeReport> poll(Phase phase) = 0;

  /// Sets `text` and `values` of `health`, and sends events that are due. Called once a second, and
  /// after each change of phase.
  virtual void report_health(HealthMessage& health) = 0;
  /// Has every thread of the pipeline completed a loop after `since`? Feeds the watchdog.
  virtual bool progressed_since(MonotonicInstant since) const = 0;
};

}  // namespace v3d
