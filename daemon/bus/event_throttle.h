// Rate limit for events that report a count which changes often.
#pragma once

#include <cstdint>

#include "base/core/time.h"

namespace v3d {

/// Permits an event for the first count, then when the count has doubled or halved, or has changed
/// and a minute has passed. Each event reports the total, so counts between events are not lost.
/// One thread.
class EventThrottle {
 public:
  static constexpr Duration kAgainAfter = std::chrono::minutes(1);

  /// Returns true when an event for `count`, which is not 0, is due; then `count` counts as
  /// reported.
  bool is_report_due(int64_t count, MonotonicInstant now) {
    const bool is_large_change = count >= 2 * reported_ || 2 * count <= reported_;
    if (count == reported_ || (!is_large_change && now - reported_at_ < kAgainAfter)) return false;
    reported_ = count;
    reported_at_ = now;
    return true;
  }

 private:
  int64_t reported_ = 0;
  MonotonicInstant reported_at_;
};

}  // namespace v3d
