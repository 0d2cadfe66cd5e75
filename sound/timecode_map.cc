#include "sound/timecode_map.h"

#include <algorithm>
#include <cmath>

namespace v3d::sound {
namespace {

/// Samples per frame within a run; negative where it runs backwards.
double pitch(const TimecodeRun& run, TimecodeRate rate, int rate_hz) {
  if (run.last_frame == run.first_frame) return rate_hz / frames_per_second(rate);
  return (run.last_sample - run.first_sample) /
         static_cast<double>(run.last_frame - run.first_frame);
}

}  // namespace

std::optional<double> timecode_frames_at(std::span<const TimecodeRun> runs, TimecodeRate rate,
                                         int rate_hz, double sample, double reach_s) {
  const TimecodeRun* nearest = nullptr;
  double least = reach_s * rate_hz;
  for (const TimecodeRun& run : runs) {
    const double before = run.first_sample - sample;
    const double after = sample - run.last_sample - std::abs(pitch(run, rate, rate_hz));
    const double distance = std::max({0.0, before, after});
    if (distance < least || (distance == 0 && least == 0)) {
      nearest = &run;
      least = distance;
    }
  }
  if (nearest == nullptr) return std::nullopt;
  const double step = pitch(*nearest, rate, rate_hz);
  if (step == 0) return std::nullopt;
  return static_cast<double>(nearest->first_frame) + (sample - nearest->first_sample) / step +
         0.5 / std::abs(step);
}

}  // namespace v3d::sound
