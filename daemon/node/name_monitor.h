// Duplicate name detection: finds another process that sends health under this node's name.
#pragma once

#include <optional>
#include <string>

#include "base/time.h"
#include "daemon/bus/bus.h"
#include "wire/messages.h"

namespace v3d {

/// Each process puts a random number into its health (`instance`). Authentic health of this node
/// with another number comes from another process: two PCs have the same node name, or a daemon
/// was started twice. One thread.
class NameMonitor {
 public:
  /// An alarm lasts so long after the last message of the other process.
  static constexpr Duration kLasts = std::chrono::seconds(3);
  /// The name of the value in HealthMessage::values.
  static constexpr const char* kInstance = "instance";

  /// `bus` outlives the monitor.
  NameMonitor(Bus& bus, std::string node);

  /// Marks health that this process is about to send.
  void mark(HealthMessage& health) const;
  /// One line for a person while another process uses the name at `now`, else empty. It starts with
  /// the second message: the first may be the last one of a process that has just ended.
  std::string alarm(MonotonicInstant now);

 private:
  void note(const HealthMessage& health, MonotonicInstant now);

  const std::string node_;
  const double instance_;
  double other_ = 0;
  int64_t messages_of_other_ = 0;
  std::optional<MonotonicInstant> last_of_other_;
  Subscription<HealthMessage> healths_;
};

}  // namespace v3d
