// Times that name their clock. An instant of one clock cannot be subtracted from an instant of
// another: the compiler refuses, which is the point.
#pragma once

#include <chrono>
#include <cstdint>

namespace v3d {

using Duration = std::chrono::nanoseconds;

/// CLOCK_REALTIME: wall-clock time, may be stepped. For names, logs and the `utime` of messages.
struct Realtime {
  using duration = Duration;
  using rep = duration::rep;
  using period = duration::period;
  using time_point = std::chrono::time_point<Realtime, Duration>;
  static constexpr bool is_steady = false;
  static time_point now();
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
