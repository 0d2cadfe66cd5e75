// Whether a disk elsewhere is full or broken, for the node that makes the pulses.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "daemon/bus/bus.h"

namespace v3d {

/// The name of the value by which a node's health tells that it ended its part of the take because
/// its disk is full or refuses frames: 1, until the next take.
inline constexpr char kDiskFull[] = "disk_full_flag";

/// True of the health of a node that ended its part of the take because of its disk.
bool reports_full_disk(const HealthMessage& health);

/// Listens to the health of other nodes. Health comes again every second: one that is lost does no
/// harm. One thread.
class DiskMonitor {
 public:
  /// `bus` outlives the watch.
  DiskMonitor(Bus& bus, const std::vector<std::string>& nodes);

  /// What was heard before does not count any more.
  void restart();
  /// The first node whose disk is full by what has come since, and empty while there is none.
  std::string full_node();

 private:
  struct Node {
    std::string name;
    std::unique_ptr<Subscription<HealthMessage>> health;
  };
  std::vector<Node> nodes_;
};

}  // namespace v3d
