// Timecode: arithmetic.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>

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

}  // namespace v3d::sound
