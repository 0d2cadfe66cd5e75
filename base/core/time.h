// Clocks with distinct types. The compiler rejects the difference of instants of two different
// clocks.
#pragma once

#include <atomic>
#include <chrono>
#include <cstdint>
#include <ctime>
#include <functional>

namespace v3d {

using Duration = std::chrono::nanoseconds;

/// Wall-clock time (CLOCK_REALTIME) without its steps: for names, logs, and the times of pulses and
/// messages.
/// It follows a clock that NTP slews. When the clock is set by more than RealtimeFollower::kSlew,
/// now() continues the previous time with CLOCK_MONOTONIC until adopt_step(). A take thus has one
/// continuous time from its first pulse to its last.
/// Thread-safe.
struct Realtime {
  using duration = Duration;
  using rep = duration::rep;
  using period = duration::period;
  using time_point = std::chrono::time_point<Realtime, Duration>;
  static constexpr bool is_steady = false;
  static time_point now();
  /// The change of CLOCK_REALTIME that this process has not adopted: negative when the clock was
  /// set back; 0 when it was not set.
  static Duration step();
  /// Adopts the step: now() jumps by step().
  static void adopt_step();
};

/// CLOCK_MONOTONIC of this host: for deadlines, and for the order of events on one machine.
struct Monotonic {
  using duration = Duration;
  using rep = duration::rep;
  using period = duration::period;
  using time_point = std::chrono::time_point<Monotonic, Duration>;
  static constexpr bool is_steady = true;
  static time_point now();
};

/// The clock of a camera, with its own zero and rate. It has no now(): its time is only known from
/// frames.
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

/// Tracks the difference of the wall clock and the monotonic clock, and detects steps of the wall
/// clock. Thread-safe.
class RealtimeFollower {
 public:
  /// Larger changes of the difference between two readings are steps; NTP slews by less.
  static constexpr Duration kSlew = std::chrono::milliseconds(50);

  /// The time without steps. Read `wall` directly after `steady`.
  RealtimeInstant follow(MonotonicInstant steady, RealtimeInstant wall);
  /// Like Realtime::step().
  Duration step(MonotonicInstant steady, RealtimeInstant wall) const;
  /// Like Realtime::adopt_step().
  void adopt(MonotonicInstant steady, RealtimeInstant wall);

 private:
  static constexpr int64_t kUnknown = INT64_MIN;
  std::atomic<int64_t> difference_ns_ = kUnknown;
};

/// Nanoseconds since the clock's zero, for messages and files.
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

// Clock and sleep of threads that pace pulses.

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
