// When a count that changes all the time is worth telling again.
#pragma once

#include <cstdint>

#include "base/core/time.h"

namespace v3d {

/// At once when it begins, then when it has doubled or halved, or after a minute. What is told is
/// the total, so nothing is lost between.
class EventThrottle {
 public:
  static constexpr Duration kAgainAfter = std::chrono::minutes(1);

  /// True when `count`, which is not 0, is to be told now; then it counts as told.
  bool is_news(int64_t count, MonotonicInstant now) {
    const bool much = count >= 2 * told_ || 2 * count <= told_;
    if (count == told_ || (!much && now - told_at_ < kAgainAfter)) return false;
    told_ = count;
    told_at_ = now;
    return true;
  }

 private:
  int64_t told_ = 0;
  MonotonicInstant told_at_;
};

}  // namespace v3d
