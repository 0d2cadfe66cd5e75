// Times of the sensed pulses of a train. They label the frames of free-running cameras.
#pragma once

#include <cstdint>
#include <deque>
#include <mutex>
#include <optional>

#include "base/core/time.h"

namespace v3d {

/// The pulse nearest to an exposure.
struct NearestPulse {
  std::optional<int64_t> pulse = {};  ///< empty: no pulse within half a period
  Duration phase{};                   ///< from the pulse to the exposure; may be negative
};

/// The latest 256 sensed pulses of a train, with times of this host's clock. Thread-safe.
class PulseTimes {
 public:
  /// Maximum time from a pulse to the call of add().
  static constexpr Duration kMaxSenseDelay = std::chrono::milliseconds(250);

  explicit PulseTimes(Duration period) : period_(period) {}

  /// Starts a train of this period and drops the pulses of the previous one.
  void begin(Duration period);
  /// Ends the train: no further pulse follows.
  void end();
  /// Adds a sensed pulse. Numbers and times must rise.
  void add(int64_t pulse, MonotonicInstant at);

  /// Period of the current or last train.
  Duration period() const;
  /// Number of trains started so far.
  int64_t trains() const;

  /// The pulse nearest to `at`, if one lies within half a period.
  ///
  /// `before` is the phase of the previous frame of the camera. It gives hysteresis: a frame keeps
  /// the pulse next to that of the previous frame until it is 0.6 periods away from it. So frames
  /// half-way between two pulses do not alternate. A pulse that was not sensed, between two sensed
  /// ones, counts as well. Empty while a pulse that is reported later may change the result.
  std::optional<NearestPulse> find(MonotonicInstant at, std::optional<Duration> before,
                                   MonotonicInstant now) const;

 private:
  struct Pulse {
    int64_t number = 0;
    MonotonicInstant at;
  };
  const Pulse& nearest_to(MonotonicInstant at) const;

  mutable std::mutex mutex_;  ///< protects everything below
  Duration period_;
  bool running_ = false;
  int64_t trains_ = 0;
  std::deque<Pulse> pulses_;  ///< the latest ones, in order
};

}  // namespace v3d
