// What a node does for its studio. The node loop calls it as the controller says.
#pragma once

#include <optional>
#include <string>

#include "base/time.h"
#include "daemon/control/control.h"
#include "wire/messages.h"

namespace v3d {

struct NodeReport {
  Input event = Input::kBroken;  ///< kReady, kFailed, kTrainEnded, kDrained or kBroken
  std::string text;              ///< one line for the operator
  std::string detail;            ///< JSON, or empty
};

/// One thread calls; no function waits, except disarm() for threads to end. What arm(), learn(),
/// start(), drain() and poll() throw becomes a refusal or a fault; no exception ends the daemon.
class NodeDelegate {
 public:
  virtual ~NodeDelegate() = default;

  virtual void arm(const CommandMessage& order) = 0;
  virtual void learn(const CommandMessage& order) = 0;
  virtual void start() = 0;
  virtual void drain() = 0;
  /// Turns everything off and closes what is open, whatever the phase. Idempotent.
  virtual void disarm() = 0;

  /// Called while the node is idle: when it was at a take before it was started anew, and the take
  /// still runs, it records into it again, and says by whose order. InputErrors are told; the node
  /// then stays as it is.
  virtual std::optional<CommandMessage> rejoin() { return std::nullopt; }

  /// What has happened since; called often.
  virtual std::optional<NodeReport> poll(Phase phase) = 0;

  /// Fills in `text` and `values`; called once a second, which is also when events are due.
  virtual void report_health(HealthMessage& health) = 0;
  /// Every thread of the pipeline went round its loop since `since`.
  virtual bool progressed_since(MonotonicInstant since) const = 0;
};

}  // namespace v3d
