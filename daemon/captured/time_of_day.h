// Local time of day of instants of the monotonic clock, also as timecode.
#pragma once

#include <ctime>

#include "base/core/time.h"
#include "sound/timecode_clock.h"

namespace v3d::captured {

/// The same instant by the realtime clock, from the current difference of the clocks.
inline RealtimeInstant to_realtime(MonotonicInstant at) {
  return Realtime::now() - (Monotonic::now() - at);
}

/// Seconds since midnight in the time zone of this process.
inline double seconds_of_day(MonotonicInstant at) {
  const int64_t ns = to_ns(to_realtime(at));
  const auto seconds = static_cast<time_t>(ns / 1'000'000'000);
  tm local{};
  localtime_r(&seconds, &local);
  return (local.tm_hour * 60.0 + local.tm_min) * 60 + local.tm_sec +
         static_cast<double>(ns % 1'000'000'000) * 1e-9;
}

/// The timecode of the time of day, from `at` on.
inline sound::TimecodeClock day_clock(sound::TimecodeRate rate, MonotonicInstant at) {
  return {rate, seconds_of_day(at) * sound::frames_per_second(rate), at};
}

}  // namespace v3d::captured
