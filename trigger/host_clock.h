// Clock of the triggers: reads CLOCK_MONOTONIC and sleeps. Tests replace it.
#pragma once

#include <ctime>
#include <functional>

#include "base/core/time.h"

namespace v3d {

/// Sleeps until an instant; returns at once when it has passed.
void sleep_until(MonotonicInstant instant);

struct HostClock {
  std::function<MonotonicInstant()> now = Monotonic::now;
  std::function<void(MonotonicInstant)> sleep_until = v3d::sleep_until;
};

/// Converts a duration, which must not be negative.
timespec to_timespec(Duration d);

}  // namespace v3d
