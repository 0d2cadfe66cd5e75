#include "base/core/time.h"

#include <cerrno>
#include <cstdlib>
#include <ctime>

namespace v3d {
namespace {

Duration read_clock(clockid_t clock) {
  timespec t{};
  clock_gettime(clock, &t);
  return std::chrono::seconds(t.tv_sec) + std::chrono::nanoseconds(t.tv_nsec);
}

RealtimeInstant wall_clock() { return RealtimeInstant(read_clock(CLOCK_REALTIME)); }

struct BothClocks {
  MonotonicInstant steady;
  RealtimeInstant wall;
};
/// Reads both clocks within 1 ms where possible; a longer gap would look like a step.
BothClocks read_both_clocks() {
  constexpr Duration kMaxGap = std::chrono::milliseconds(1);
  constexpr int kTries = 100;
  BothClocks clocks;
  for (int i = 0; i < kTries; ++i) {
    clocks = {Monotonic::now(), wall_clock()};
    if (Monotonic::now() - clocks.steady < kMaxGap) break;
  }
  return clocks;
}

RealtimeFollower& follower() {
  static RealtimeFollower follower;
  return follower;
}

}  // namespace

RealtimeInstant Realtime::now() {
  const MonotonicInstant steady = Monotonic::now();
  return follower().follow(steady, wall_clock());
}
Duration Realtime::step() {
  const auto [steady, wall] = read_both_clocks();
  return follower().step(steady, wall);
}
void Realtime::adopt_step() {
  const auto [steady, wall] = read_both_clocks();
  follower().adopt(steady, wall);
}
MonotonicInstant Monotonic::now() { return MonotonicInstant(read_clock(CLOCK_MONOTONIC)); }

RealtimeInstant RealtimeFollower::follow(MonotonicInstant steady, RealtimeInstant wall) {
  const int64_t difference = to_ns(wall) - to_ns(steady);
  int64_t known = difference_ns_.load(std::memory_order_relaxed);
  if (known == kUnknown && difference_ns_.compare_exchange_strong(known, difference)) return wall;
  const int64_t change = difference - known;
  if (std::abs(change) > kSlew.count()) return from_ns<Realtime>(to_ns(steady) + known);
  constexpr int64_t kMinUpdateNs = 1000;  // all threads read the difference, so avoid small writes
  if (std::abs(change) > kMinUpdateNs) difference_ns_.store(difference, std::memory_order_relaxed);
  return wall;
}

Duration RealtimeFollower::step(MonotonicInstant steady, RealtimeInstant wall) const {
  const int64_t known = difference_ns_.load(std::memory_order_relaxed);
  if (known == kUnknown) return {};
  const Duration change(to_ns(wall) - to_ns(steady) - known);
  return std::chrono::abs(change) > kSlew ? change : Duration{};
}

void RealtimeFollower::adopt(MonotonicInstant steady, RealtimeInstant wall) {
  difference_ns_.store(to_ns(wall) - to_ns(steady), std::memory_order_relaxed);
}

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
