#include "base/time.h"

#include <ctime>

namespace v3d {
namespace {

Duration read_clock(clockid_t clock) {
  timespec t{};
  clock_gettime(clock, &t);
  return std::chrono::seconds(t.tv_sec) + std::chrono::nanoseconds(t.tv_nsec);
}

}  // namespace

RealtimeInstant Realtime::now() { return RealtimeInstant(read_clock(CLOCK_REALTIME)); }
MonotonicInstant Monotonic::now() { return MonotonicInstant(read_clock(CLOCK_MONOTONIC)); }

}  // namespace v3d
