// Watches that the cameras of one model have the same firmware in the whole studio.
#pragma once

#include <map>
#include <memory>
#include <string>
#include <vector>

#include "daemon/bus/bus.h"
#include "wire/messages.h"

namespace v3d::captured {

/// Reads the models and firmware of the cameras of other nodes from their health. The trigger's
/// node has one, so the studio reports a difference once. One thread.
class FirmwareMonitor {
 public:
  /// `nodes`: the other capture nodes. `bus` outlives the monitor.
  FirmwareMonitor(bus::Bus& bus, const std::vector<std::string>& nodes);

  /// Reads the messages that have arrived; never waits. Returns control::firmware_differences() of
  /// them and of `own`, the health of this node. A node that falls silent keeps its last cameras.
  std::string differences(const wire::HealthMessage& own);

 private:
  std::vector<std::unique_ptr<bus::Subscription<wire::HealthMessage>>> subscriptions_;
  std::map<std::string, wire::HealthMessage> health_;  ///< last of each node
};

}  // namespace v3d::captured
