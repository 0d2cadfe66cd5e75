// Detects the end of a take on all nodes from their health messages.
#pragma once

#include <cstdint>
#include <map>
#include <string>
#include <vector>

#include "base/core/time.h"
#include "wire/messages.h"

namespace v3d::ctl {

/// Follows a take that was started. States of nodes decide, because counts of pulses cannot: a
/// pulse may have been lost. No input or output. One thread.
class TakeProgress {
 public:
  /// Health comes every second. A busy node may skip some messages; without one for this long, it
  /// is silent.
  static constexpr Duration kSilentAfter = std::chrono::seconds(15);

  /// `nodes`: all that record or reconstruct the take. `start`: the time from which they have sent
  /// health.
  TakeProgress(std::vector<std::string> nodes, std::string trigger_node, MonotonicInstant start);

  void on_health(const wire::HealthMessage& health, MonotonicInstant now);

  enum class State : uint8_t {
    kRunning,
    kEnded,            ///< no node is in a take, except silent nodes
    kTriggerIsSilent,  ///< whether pulses run is unknown
  };
  State state(MonotonicInstant now) const;

  /// The last health of each node that is not silent.
  std::map<std::string, wire::HealthMessage> health(MonotonicInstant now) const;

 private:
  struct Node {
    MonotonicInstant last;  ///< time of the last health
    bool has_reported = false;
    wire::HealthMessage health;
  };
  static bool is_silent(const Node& node, MonotonicInstant now) {
    return now - node.last > kSilentAfter;
  }

  const std::string trigger_node_;
  std::map<std::string, Node> nodes_;
};

}  // namespace v3d::ctl
