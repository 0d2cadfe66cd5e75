// Timecode of a Broadcast Wave file, and its chunk iXML.
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <string_view>

#include "base/core/time.h"
#include "sound/timecode.h"

namespace v3d::sound {

/// The timecode of the first sample of a file.
struct WaveTimecode {
  TimecodeRate rate = TimecodeRate::k25;
  /// The time that the frames since midnight last at `rate`, in samples of the file: the time
  /// reference of EBU Tech 3285. At 29.97 frames per second without dropped numbers, 01:00:00:00 is
  /// 3603.6 s.
  int64_t samples_since_midnight = 0;

  /// "10:00:00:00", timecode_text(). `rate_hz`: samples per second.
  std::string text(int rate_hz) const;
  friend bool operator==(const WaveTimecode&, const WaveTimecode&) = default;
};

/// The timecode of sample 0. Where the timecode begins later, it is continued backwards. Empty
/// without runs.
std::optional<WaveTimecode> first_timecode(std::span<const TimecodeRun> runs, TimecodeRate rate,
                                           int rate_hz);

/// What the chunk iXML of a file states. Source: iXML specification 3.01 (Gallery Software).
struct WaveMetadata {
  int rate_hz = 48'000;
  int64_t samples_since_midnight = 0;           ///< as in the chunk `bext`
  std::optional<TimecodeRate> timecode_rate;    ///< empty: `samples_since_midnight` is local time
  std::optional<RealtimeInstant> first_sample;  ///< wall-clock time, whatever the timecode is
};

/// The chunk has this length in every file, so that it can be replaced. Spaces fill it.
inline constexpr size_t kMetadataBytes = 1024;

/// The text of the chunk, of kMetadataBytes.
std::string write_metadata(const WaveMetadata& metadata);
/// Reads `timecode_rate` and `first_sample`; both are empty where the text lacks them, or has other
/// values. Any text.
WaveMetadata read_metadata(std::string_view text);

}  // namespace v3d::sound
