// LtcPlayer: longitudinal timecode for a device that plays it.
#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include "base/core/time.h"
#include "sound/ltc.h"
#include "sound/sample_clock.h"
#include "sound/timecode_clock.h"

namespace v3d::sound {

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
