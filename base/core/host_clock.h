// Clock and sleep of threads that pace pulses.
#pragma once

#include <ctime>
#include <functional>

#include "base/core/time.h"

namespace v3d {

/// Converts a duration, which must not be negative.
timespec to_timespec(Duration d);

/// Sleeps until an instant; returns at once when it has passed.
void sleep_until(MonotonicInstant instant);

/// Reads CLOCK_MONOTONIC and sleeps. Tests replace it.
struct HostClock {
  std::function<MonotonicInstant()> now = Monotonic::now;
  std::function<void(MonotonicInstant)> sleep_until = v3d::sleep_until;
};

/// A pulse that starts later than this counts as late in the ledger: a tenth of the period of the
/// pulses. Then every instant of the train is known to a tenth of a frame without the sensed times.
constexpr Duration max_pulse_lateness(Duration period) { return period / 10; }

}  // namespace v3d
