// TimecodeTrack: the timecode of a recording, from its LTC.
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <vector>

#include "sound/timecode.h"
#include "sound/timecode_map.h"

namespace v3d::sound {

/// The timecode of every position of a recording, from the frames that were read. Stores runs of
/// consecutive frames, kMaxRuns at most: memory does not depend on the length. One thread.
class TimecodeTrack {
 public:
  static constexpr size_t kMaxRuns = 1000;

  /// `rate`: empty to derive it from the length of the first kRateFrames frames and their flag, at
  /// normal speed.
  TimecodeTrack(int rate_hz, std::optional<TimecodeRate> rate);

  void add(const LtcFrame& frame);

  /// Empty until it is known.
  std::optional<TimecodeRate> rate() const { return rate_; }
  /// The runs of consecutive frames so far, by position.
  const std::vector<TimecodeRun>& runs() const { return runs_; }
  /// The timecode at a position, by timecode_frames_at().
  std::optional<Timecode> at(double sample) const;
  /// Places where a frame does not follow the one before it: jumps of the source, and gaps.
  int64_t jumps() const { return jumps_; }
  int64_t frames() const { return frames_; }

 private:
  static constexpr size_t kRateFrames = 12;

  void find_rate();
  void append(const LtcFrame& frame);

  const int rate_hz_;
  std::optional<TimecodeRate> rate_;
  std::vector<LtcFrame> pending_;  ///< before the rate is known
  std::vector<TimecodeRun> runs_;
  int64_t frames_ = 0, jumps_ = 0;
};

}  // namespace v3d::sound
