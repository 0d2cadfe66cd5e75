// How a trigger knows and awaits the time; tests have their own.
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

/// As the kernel wants a duration that is not negative.
timespec to_timespec(Duration d);

}  // namespace v3d
