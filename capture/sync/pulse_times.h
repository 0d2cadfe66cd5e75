// When the pulses were: what labels the frames of cameras that run free.
#pragma once

#include <cstdint>
#include <deque>
#include <mutex>
#include <optional>

#include "base/core/time.h"

namespace v3d {

/// Which pulse an exposure belongs to.
struct PulsePlace {
  std::optional<int64_t> pulse = {};  ///< empty: none was near
  Duration phase{};                   ///< the exposure's, after that pulse; may be negative
};

/// The pulses of a train by this host's clock, as far as they have been sensed. Any thread.
class PulseTimes {
 public:
  /// What sensed a pulse tells of it within this time.
  static constexpr Duration kSenseLatency = std::chrono::milliseconds(250);

  explicit PulseTimes(Duration period) : period_(period) {}

  /// A train of this period may come; forgets the one before.
  void begin(Duration period);
  /// No pulse comes any more.
  void end();
  /// A pulse was sensed; numbers and times rise.
  void add(int64_t pulse, MonotonicInstant at);

  /// Of the train, or of the last one.
  Duration period() const;
  /// How many trains have begun.
  int64_t trains() const;

  /// The pulse nearest to `at`, if one lies within half a period. A camera slides along the pulses:
  /// so that frames half-way between two of them do not jump to and fro, a frame stays with the
  /// pulse that follows on from `before`, the phase of the frame before it, until it is six tenths
  /// of a period away. A pulse that was not sensed between two that were has its place, too. Empty
  /// as long as a pulse that is heard of later may still change the answer.
  std::optional<PulsePlace> find(MonotonicInstant at, std::optional<Duration> before,
                                 MonotonicInstant now) const;

 private:
  struct Pulse {
    int64_t number = 0;
    MonotonicInstant at;
  };
  const Pulse& nearest_to(MonotonicInstant at) const;

  mutable std::mutex mutex_;  ///< everything below
  Duration period_;
  bool begun_ = false;
  int64_t trains_ = 0;
  std::deque<Pulse> pulses_;  ///< the latest
};

}  // namespace v3d
