#include "sound/timecode.h"

#include <fmt/core.h>

#include <cmath>
#include <cstdio>

#include "base/core/error.h"

namespace v3d::sound {
namespace {

constexpr std::array<std::string_view, 5> kNames = {"24", "25", "29.97", "29.97df", "30"};
constexpr int kMinutesPerDay = 24 * 60;
/// Numbers that are dropped at the start of a minute.
constexpr int kDropped = 2;

bool drops(TimecodeRate rate) { return rate == TimecodeRate::k2997Drop; }

/// Numbers that were dropped before a minute of the day.
int64_t dropped_before(int64_t minute, TimecodeRate rate) {
  return drops(rate) ? kDropped * (minute - minute / 10) : 0;
}

}  // namespace

std::string_view name(TimecodeRate rate) { return kNames[static_cast<size_t>(rate)]; }

std::optional<TimecodeRate> timecode_rate_from_name(std::string_view text) {
  for (const TimecodeRate rate : kTimecodeRates) {
    if (text == name(rate)) return rate;
  }
  return std::nullopt;
}

int counted_frames(TimecodeRate rate) {
  return rate == TimecodeRate::k24 ? 24 : rate == TimecodeRate::k25 ? 25 : 30;
}

double frames_per_second(TimecodeRate rate) {
  const bool is_2997 = rate == TimecodeRate::k2997 || rate == TimecodeRate::k2997Drop;
  return is_2997 ? 30'000.0 / 1001 : counted_frames(rate);
}

bool is_valid(const Timecode& t, TimecodeRate rate) {
  const bool is_dropped =
      drops(rate) && t.frames < kDropped && t.seconds == 0 && t.minutes % 10 != 0;
  return t.hours >= 0 && t.hours < 24 && t.minutes >= 0 && t.minutes < 60 && t.seconds >= 0 &&
         t.seconds < 60 && t.frames >= 0 && t.frames < counted_frames(rate) && !is_dropped;
}

int64_t frames_per_day(TimecodeRate rate) {
  return int64_t{kMinutesPerDay} * 60 * counted_frames(rate) - dropped_before(kMinutesPerDay, rate);
}

int64_t frame_number(const Timecode& t, TimecodeRate rate) {
  V3D_CHECK(is_valid(t, rate));
  const int64_t minute = t.hours * 60 + t.minutes;
  return (minute * 60 + t.seconds) * counted_frames(rate) + t.frames - dropped_before(minute, rate);
}

Timecode timecode_of(int64_t number, TimecodeRate rate) {
  const int64_t day = frames_per_day(rate);
  int64_t left = (number % day + day) % day;
  const int64_t counted = counted_frames(rate);
  // The first of ten minutes has all numbers, the others lack the dropped ones.
  const int64_t minute_frames = 60 * counted - (drops(rate) ? kDropped : 0);
  const int64_t ten_minutes = 10 * minute_frames + (drops(rate) ? kDropped : 0);
  int64_t minute = left / ten_minutes * 10;
  left %= ten_minutes;
  if (left >= 60 * counted) {
    const int64_t further = (left - 60 * counted) / minute_frames;
    minute += 1 + further;
    left = left - 60 * counted - further * minute_frames + (drops(rate) ? kDropped : 0);
  }
  return {.hours = static_cast<int>(minute / 60),
          .minutes = static_cast<int>(minute % 60),
          .seconds = static_cast<int>(left / counted),
          .frames = static_cast<int>(left % counted)};
}

std::string timecode_text(const Timecode& t, TimecodeRate rate) {
  return fmt::format("{:02}:{:02}:{:02}{}{:02}", t.hours, t.minutes, t.seconds,
                     drops(rate) ? ';' : ':', t.frames);
}

std::optional<Timecode> parse_timecode(std::string_view text, TimecodeRate rate) {
  Timecode t;
  const std::string copy(text);
  char mark = 0;
  if (std::sscanf(copy.c_str(), "%2d:%2d:%2d%c%2d", &t.hours, &t.minutes, &t.seconds, &mark,
                  &t.frames) != 5) {
    return std::nullopt;
  }
  const bool is_same = is_valid(t, rate) && timecode_text(t, rate) == text;
  return is_same ? std::optional(t) : std::nullopt;
}

Timecode timecode_of_day(double seconds_since_midnight, TimecodeRate rate) {
  return timecode_of(std::llround(std::floor(seconds_since_midnight * frames_per_second(rate))),
                     rate);
}

}  // namespace v3d::sound
