// Times that name their clock. An instant of one clock cannot be subtracted from an instant of
// another: the compiler refuses, which is the point.
#pragma once

#include <atomic>
#include <chrono>
#include <cstdint>

namespace v3d {

using Duration = std::chrono::nanoseconds;

/// CLOCK_REALTIME without its steps: wall-clock time, for names, logs, and the times of pulses and
/// messages. It follows a clock that NTP slews. When the clock is set by more than
/// RealtimeFollower::kSlew, the process goes on with the time of before, carried by
/// CLOCK_MONOTONIC, until adopt_step(): a take has one time from its first pulse to its last. Any
/// thread.
struct Realtime {
  using duration = Duration;
  using rep = duration::rep;
  using period = duration::period;
  using time_point = std::chrono::time_point<Realtime, Duration>;
  static constexpr bool is_steady = false;
  static time_point now();
  /// How far CLOCK_REALTIME has been set, and this process has not followed: negative when it was
  /// set back; 0 when it was not set.
  static Duration step();
  /// Follows. now() jumps by step().
  static void adopt_step();
};

/// CLOCK_MONOTONIC of this host: for deadlines, and for what happened when on one machine.
struct Monotonic {
  using duration = Duration;
  using rep = duration::rep;
  using period = duration::period;
  using time_point = std::chrono::time_point<Monotonic, Duration>;
  static constexpr bool is_steady = true;
  static time_point now();
};

/// A camera's own clock: its zero and its rate are its own, and it cannot be asked for the time.
struct DeviceClock {
  using duration = Duration;
  using rep = duration::rep;
  using period = duration::period;
  using time_point = std::chrono::time_point<DeviceClock, Duration>;
  static constexpr bool is_steady = true;
};

using RealtimeInstant = Realtime::time_point;
using MonotonicInstant = Monotonic::time_point;
using DeviceInstant = DeviceClock::time_point;

/// The difference of the two clocks, as far as the wall clock was not set. Any thread.
class RealtimeFollower {
 public:
  /// NTP slews by less between two readings; a larger difference is a step.
  static constexpr Duration kSlew = std::chrono::milliseconds(50);

  /// The time without steps. `wall` was read directly after `steady`.
  RealtimeInstant follow(MonotonicInstant steady, RealtimeInstant wall);
  /// As Realtime::step().
  Duration step(MonotonicInstant steady, RealtimeInstant wall) const;
  void adopt(MonotonicInstant steady, RealtimeInstant wall);

 private:
  static constexpr int64_t kUnknown = INT64_MIN;
  std::atomic<int64_t> difference_ns_ = kUnknown;
};

/// Nanoseconds since the clock's zero, for the wire and for files.
template <class Clock>
constexpr int64_t to_ns(std::chrono::time_point<Clock, Duration> t) {
  return t.time_since_epoch().count();
}
template <class Clock>
constexpr std::chrono::time_point<Clock, Duration> from_ns(int64_t ns) {
  return std::chrono::time_point<Clock, Duration>(Duration(ns));
}

constexpr double to_seconds(Duration d) { return std::chrono::duration<double>(d).count(); }
constexpr Duration from_seconds(double s) {
  return std::chrono::duration_cast<Duration>(std::chrono::duration<double>(s));
}
/// The time between two pulses of a train.
constexpr Duration period_of(double rate_hz) { return from_seconds(1.0 / rate_hz); }

}  // namespace v3d
