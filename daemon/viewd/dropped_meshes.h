// Lines for the log about live meshes that are dropped before they reach a browser.
#pragma once

#include <cstdint>
#include <optional>
#include <string>

#include "base/core/time.h"
#include "daemon/bus/event_sender.h"
#include "daemon/viewd/web_streams.h"

namespace v3d::viewd {

/// EventThrottle limits the lines. To be called repeatedly. One thread.
class DroppedMeshes {
 public:
  /// The line that is due for the counts of a LiveFeed; empty: none. Not reported are meshes that
  /// arrive twice, and those that a slow browser misses, which its page counts.
  std::optional<std::string> line(const LiveFeedCounts& counts, MonotonicInstant now);
  /// The same for the meshes that the relay process dropped, because they waited too long.
  std::optional<std::string> line_of_relay(int64_t dropped, MonotonicInstant now);

 private:
  bus::EventThrottle unusable_;
  bus::EventThrottle waiting_;
};

}  // namespace v3d::viewd
