// TimecodeTrack: the timecode of a recording, from its LTC.
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <vector>

#include "sound/timecode.h"
#include "sound/timecode_map.h"

namespace v3d::sound {

/// A place where the timecode does not continue.
struct TimecodeJump {
  double sample = 0;     ///< where the frame after it begins
  int64_t expected = 0;  ///< that frame, if the timecode had continued: frame_number()
  int64_t found = 0;     ///< that frame
  friend bool operator==(const TimecodeJump&, const TimecodeJump&) = default;
};

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
  /// Places where a frame has another number than the frame before it predicts, by the time between
  /// them. Adjacent frames of which none follows count once: a jump within a frame damages that
  /// frame, too. A gap after which the timecode is right is no jump.
  int64_t jumps() const { return jumps_; }
  const std::optional<TimecodeJump>& first_jump() const { return first_jump_; }
  int64_t frames() const { return frames_; }

 private:
  static constexpr size_t kRateFrames = 12;

  void find_rate();
  void append(const LtcFrame& frame);
  /// Frames from the one at `last_sample` to `frame`: 1 where it is the next.
  int64_t steps_to(const LtcFrame& frame, int64_t last_sample) const;
  void note_jump(const TimecodeJump& jump);

  const int rate_hz_;
  std::optional<TimecodeRate> rate_;
  std::vector<LtcFrame> pending_;  ///< before the rate is known
  std::vector<TimecodeRun> runs_;
  struct Last {
    int64_t sample = 0, number = 0;
  };
  std::optional<Last> last_;  ///< the last frame
  int64_t frames_ = 0, jumps_ = 0;
  std::optional<TimecodeJump> first_jump_;
  bool has_jumped_ = false;  ///< at the last frame
};

}  // namespace v3d::sound
