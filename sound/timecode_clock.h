// TimecodeClock: the timecode of a generator in step with the pulses.
#pragma once

#include <cstdint>
#include <optional>

#include "base/core/time.h"
#include "sound/clock_filter.h"
#include "sound/timecode.h"

namespace v3d::sound {

/// Timecode as a function of the host's monotonic clock.
///
/// Between trains of pulses it counts on the host's clock, from the frame and the instant of the
/// constructor. In a train it counts on the clock of the pulses: in n nominal periods of the
/// pulses as many frames as n periods last. It never jumps. After a train it returns to the count
/// on the host's clock, by kMaxSlew. One thread; may be copied.
class TimecodeClock {
 public:
  /// Change of the rate on the way back to the host's clock.
  static constexpr double kMaxSlew = 1e-3;
  /// A train ends this long after its last pulse.
  static constexpr Duration kTrainEnd = std::chrono::seconds(2);

  /// `frames`: frames since midnight at `at`, with their fraction.
  TimecodeClock(TimecodeRate rate, double frames, MonotonicInstant at);

  TimecodeRate rate() const { return rate_; }
  /// The next pulse is the first of a train of this rate.
  void begin_train(double pulse_rate_hz);
  /// A pulse of the train and its time. Numbers ascend; pulses before begin_train() are ignored.
  void add_pulse(int64_t pulse, MonotonicInstant at);
  /// Frames since midnight, with their fraction; may exceed a day (timecode_of()). Within a train,
  /// exact at its first pulse and from its last one on, linear between.
  double frames_at(MonotonicInstant at) const;

 private:
  struct Train {
    int64_t first_pulse = 0;
    MonotonicInstant first{}, last{};
    double offset = 0;       ///< offset_at() at the first pulse
    ClockFilter pulses{{}};  ///< of the pulses' clock against the host's, s
  };

  /// Difference to the count on the host's clock, s.
  double offset_at(MonotonicInstant at) const;
  double offset_in_train(MonotonicInstant at) const;

  TimecodeRate rate_;
  double frames_;
  MonotonicInstant start_;
  double pulse_rate_hz_ = 0;
  bool awaits_train_ = false;
  std::optional<Train> train_;  ///< the present or the last one
};

}  // namespace v3d::sound
