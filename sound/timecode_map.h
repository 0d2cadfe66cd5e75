// Timecode of the positions of a recording.
#pragma once

#include <cstdint>
#include <optional>
#include <span>

#include "sound/timecode.h"

namespace v3d::sound {

/// Consecutive frames of timecode in a recording. With one frame alone both ends are equal.
struct TimecodeRun {
  double first_sample = 0;  ///< where the first frame begins
  int64_t first_frame = 0;  ///< since midnight: frame_number()
  double last_sample = 0;   ///< where the last frame begins; not below first_sample
  int64_t last_frame = 0;   ///< below first_frame where the timecode runs backwards
  friend bool operator==(const TimecodeRun&, const TimecodeRun&) = default;
};

/// Frames since midnight at a position, with their fraction: of the run there, or of the nearest
/// run, continued for less than `reach_s` seconds. The result may exceed a day, as timecode_of()
/// permits. A position within half a sample before a frame has the number of that frame, because
/// positions of frames are rounded. Empty far from all runs. `rate_hz`: samples per second.
std::optional<double> timecode_frames_at(std::span<const TimecodeRun> runs, TimecodeRate rate,
                                         int rate_hz, double sample, double reach_s = 1);

}  // namespace v3d::sound
