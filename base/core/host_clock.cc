#include "base/core/host_clock.h"

#include <cerrno>

namespace v3d {

timespec to_timespec(Duration d) {
  const auto seconds = std::chrono::duration_cast<std::chrono::seconds>(d);
  return {seconds.count(), (d - seconds).count()};
}

void sleep_until(MonotonicInstant instant) {
  const timespec until = to_timespec(instant.time_since_epoch());
  while (clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, &until, nullptr) == EINTR) {
  }
}

}  // namespace v3d
