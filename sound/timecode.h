// Timecode: arithmetic, positions in a recording, and the track of a recording.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

namespace v3d::sound {

/// Frame rates of timecode. Source: SMPTE ST 12-1.
enum class TimecodeRate : uint8_t {
  k24,
  k25,
  k2997,      ///< 30000/1001 frames per second, counted as 30: slow against the clock
  k2997Drop,  ///< the same with dropped numbers: within 0.1 s of the clock in a day
  k30,
};
inline constexpr std::array kTimecodeRates = {TimecodeRate::k24, TimecodeRate::k25,
                                              TimecodeRate::k2997, TimecodeRate::k2997Drop,
                                              TimecodeRate::k30};

/// "24", "25", "29.97", "29.97df", "30"
std::string_view name(TimecodeRate rate);
std::optional<TimecodeRate> timecode_rate_from_name(std::string_view name);
double frames_per_second(TimecodeRate rate);
/// The count of frame numbers in a second: 24, 25 or 30.
int counted_frames(TimecodeRate rate);

struct Timecode {
  int hours = 0;
  int minutes = 0;
  int seconds = 0;
  int frames = 0;
  friend bool operator==(const Timecode&, const Timecode&) = default;
};

/// True for a timecode that exists at this rate. With dropped numbers, frames 0 and 1 of each
/// minute do not exist, except in minutes 0, 10, 20, 30, 40 and 50.
bool is_valid(const Timecode& timecode, TimecodeRate rate);
int64_t frames_per_day(TimecodeRate rate);
/// The number of frames since midnight. Requires is_valid().
int64_t frame_number(const Timecode& timecode, TimecodeRate rate);
/// The inverse, modulo a day.
Timecode timecode_of(int64_t frame_number, TimecodeRate rate);
/// "15:04:05:12"; with dropped numbers "15:04:05;12".
std::string timecode_text(const Timecode& timecode, TimecodeRate rate);
/// Parses timecode_text(). Empty for other texts, and when the timecode does not exist.
std::optional<Timecode> parse_timecode(std::string_view text, TimecodeRate rate);
/// The timecode of a free-running generator that was set at midnight.
Timecode timecode_of_day(double seconds_since_midnight, TimecodeRate rate);

/// A frame of longitudinal timecode in a recording.
struct LtcFrame {
  Timecode timecode;
  bool is_drop = false;     ///< flag of dropped numbers
  bool is_reverse = false;  ///< the tape ran backwards
  int64_t sample = 0;       ///< of its first bit
  int64_t samples = 0;      ///< length
};

// Timecode of the positions of a recording.

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

// TimecodeTrack: the timecode of a recording, from its LTC.

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
