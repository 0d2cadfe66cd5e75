// Generated timecode: in step with the pulses, and as LTC for a device that plays it.
#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include "base/core/time.h"
#include "sound/clock_filter.h"
#include "sound/ltc.h"
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

// LtcPlayer: longitudinal timecode for a device that plays it.

/// Makes the samples of a device so that each frame of LTC begins when a TimecodeClock has its
/// number, by the clock of the device (SampleClock).
///
/// The length of each frame corrects the phase, by at most kMaxStretch; where that is not enough,
/// as after an underrun, silence follows until the next frame. It is silent, too, until the clock
/// of the device is known. One thread.
class LtcPlayer {
 public:
  /// An LTC reader follows such changes of the length.
  static constexpr double kMaxStretch = 0.01;

  LtcPlayer(int rate_hz, TimecodeRate rate);

  /// The device had played `played` samples of those that next() returned at `at`.
  void add_stamp(int64_t played, MonotonicInstant at) { device_.add_stamp(played, at); }
  /// The device had no samples for a while.
  void add_underrun();
  /// The next `count` samples, of full scale.
  std::vector<float> next(int64_t count, const TimecodeClock& clock);

 private:
  void append_frame(const TimecodeClock& clock);
  void append_silence(double samples);

  const int rate_hz_;
  const TimecodeRate rate_;
  SampleClock device_;
  std::optional<LtcWriter> writer_;  ///< empty: silent
  int64_t next_frame_ = 0;           ///< of the writer; since midnight, may exceed a day
  int64_t position_ = 0;             ///< samples until the end of buffer_
  std::vector<float> buffer_;        ///< made, and not returned
};

}  // namespace v3d::sound
