// Duplicate name detection: finds another process that sends health under this node's name.
#pragma once

#include <optional>
#include <string>

#include "base/core/time.h"
#include "daemon/bus/bus.h"
#include "wire/messages.h"

namespace v3d {

/// Each process puts a random number into its health (`instance`). Authentic health of this node
/// with another number comes from another process: two PCs have the same node name, or a daemon
/// was started twice. One thread.
class NameMonitor {
 public:
  /// The alarm ends this long after the last message of the other process.
  static constexpr Duration kAlarmTime = std::chrono::seconds(3);
  /// Name of a health value: the random number of the process.
  static constexpr const char* kInstance = "instance";

  /// `bus` outlives the monitor.
  NameMonitor(Bus& bus, std::string node);

  /// Adds this process' number to a health message before it is sent.
  void mark(HealthMessage& health) const;
  /// One line for the operator while another process uses the name at `now`, else empty. Starts
  /// with its second message: the first may be the last one of a process that has just ended.
  std::string alarm(MonotonicInstant now);

 private:
  void on_health(const HealthMessage& health, MonotonicInstant now);

  const std::string node_;
  const double instance_;
  double other_ = 0;
  int64_t messages_of_other_ = 0;
  std::optional<MonotonicInstant> last_of_other_;
  Subscription<HealthMessage> healths_;
};

}  // namespace v3d
