// Detects full or broken disks on other capture nodes, from their health messages. The trigger's
// node then ends the train.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "daemon/bus/bus.h"

namespace v3d {

/// Name of a health value: 1 from the time a node ended its part of the take because its disk is
/// full or frames could not be written, until the next take.
inline constexpr char kDiskFull[] = "disk_full_flag";

/// True if `health` has kDiskFull set.
bool reports_full_disk(const HealthMessage& health);

/// Subscribes to the health of other nodes. Health is sent every second, so a lost message only
/// delays the result. One thread.
class DiskMonitor {
 public:
  /// `bus` outlives the monitor.
  DiskMonitor(Bus& bus, const std::vector<std::string>& nodes);

  /// Discards the messages received so far.
  void reset();
  /// Reads the messages that have arrived. Returns the name of a node whose disk is full, or an
  /// empty string. Never waits.
  std::string full_node();

 private:
  struct Node {
    std::string name;
    std::unique_ptr<Subscription<HealthMessage>> health;
  };
  std::vector<Node> nodes_;
};

}  // namespace v3d
