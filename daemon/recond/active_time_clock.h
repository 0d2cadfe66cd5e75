// Time as a loop has lived through it.
#pragma once

#include <algorithm>
#include <optional>

#include "base/time.h"

namespace v3d {

/// Who stood still (a machine that was stopped, or had no time for this thread) has not heard that
/// others were silent meanwhile. So of the time between two turns of a loop no more than kMostATurn
/// counts. One thread.
class ActiveTimeClock {
 public:
  static constexpr Duration kMostATurn = std::chrono::milliseconds(100);

  /// How long the loop has been awake, at `now`, which never goes back.
  Duration turn(MonotonicInstant now) {
    if (last_) awake_ += std::min<Duration>(now - *last_, kMostATurn);
    last_ = now;
    return awake_;
  }

 private:
  std::optional<MonotonicInstant> last_;
  Duration awake_{};
};

}  // namespace v3d
