#include "sound/timecode.h"

#include <fmt/core.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <utility>

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
  // The end of a frame comes first where the timecode runs backwards.
  const double begin = static_cast<double>(nearest->first_frame) + (step < 0 ? 1 : 0);
  return begin + (sample - nearest->first_sample) / step + 0.5 / step;
}

namespace {

/// Frames by which the timecode may be off after a gap of more than a second.
constexpr int64_t kGapTolerance = 1;
/// The length of a frame may differ from the nominal one by this share at normal speed.
constexpr double kNormalSpeed = 0.02;

/// A difference of frame numbers, modulo a day.
int64_t within_half_day(int64_t difference, TimecodeRate rate) {
  const int64_t day = frames_per_day(rate);
  const int64_t positive = (difference % day + day) % day;
  return positive > day / 2 ? positive - day : positive;
}

}  // namespace

TimecodeTrack::TimecodeTrack(int rate_hz, std::optional<TimecodeRate> rate)
    : rate_hz_(rate_hz), rate_(rate) {}

void TimecodeTrack::add(const LtcFrame& frame) {
  ++frames_;
  if (rate_) return append(frame);
  pending_.push_back(frame);
  if (pending_.size() < kRateFrames) return;
  find_rate();
  for (const LtcFrame& first : pending_) append(first);
  pending_.clear();
}

/// The rate whose frames have the length nearest to the median.
void TimecodeTrack::find_rate() {
  std::vector<int64_t> spans;  // of ten frames, which is exact to a tenth of a sample
  constexpr size_t kSpan = 10;
  for (size_t i = kSpan; i < pending_.size(); ++i) {
    spans.push_back(pending_[i].sample - pending_[i - kSpan].sample);
  }
  std::ranges::sort(spans);
  const double fps = kSpan * static_cast<double>(rate_hz_) /
                     static_cast<double>(std::max<int64_t>(1, spans[spans.size() / 2]));
  const bool is_drop = pending_.back().is_drop;
  double nearest = INFINITY;
  for (const TimecodeRate rate : kTimecodeRates) {
    if ((rate == TimecodeRate::k2997Drop) != is_drop) continue;
    const double distance = std::abs(frames_per_second(rate) - fps);
    if (distance < nearest) rate_ = rate;
    nearest = std::min(nearest, distance);
  }
}

void TimecodeTrack::append(const LtcFrame& frame) {
  if (!is_valid(frame.timecode, *rate_)) return;  // damaged
  const auto sample = static_cast<double>(frame.sample);
  const int64_t number = frame_number(frame.timecode, *rate_);
  const auto before = std::exchange(last_, Last{.sample = frame.sample, .number = number});
  if (before) {
    const int64_t steps = steps_to(frame, before->sample);
    const int64_t expected = before->number + (frame.is_reverse ? -steps : steps);
    const bool continues = std::abs(within_half_day(number - expected, *rate_)) <=
                           (steps > counted_frames(*rate_) ? kGapTolerance : 0);
    if (!continues) note_jump({.sample = sample, .expected = expected, .found = number});
    has_jumped_ = !continues;
    TimecodeRun& run = runs_.back();
    // Not after kMaxRuns runs, and not at midnight, where the numbers begin again.
    if (continues && steps == 1 && run.last_frame == before->number && expected == number) {
      run.last_frame = number;
      run.last_sample = sample;
      return;
    }
  }
  if (runs_.size() < kMaxRuns) runs_.push_back({sample, number, sample, number});
}

int64_t TimecodeTrack::steps_to(const LtcFrame& frame, int64_t last_sample) const {
  const double nominal = rate_hz_ / frames_per_second(*rate_);
  const auto measured = static_cast<double>(frame.samples);
  const bool is_nominal = std::abs(measured - nominal) < kNormalSpeed * nominal;
  const auto distance = static_cast<double>(frame.sample - last_sample);
  return std::max<int64_t>(1, std::llround(distance / (is_nominal ? nominal : measured)));
}

void TimecodeTrack::note_jump(const TimecodeJump& jump) {
  if (has_jumped_) return;  // the same place
  ++jumps_;
  if (!first_jump_) first_jump_ = jump;
}

std::optional<Timecode> TimecodeTrack::at(double sample) const {
  if (!rate_) return std::nullopt;
  const auto frames = timecode_frames_at(runs_, *rate_, rate_hz_, sample);
  if (!frames) return std::nullopt;
  return timecode_of(std::llround(std::floor(*frames)), *rate_);
}

}  // namespace v3d::sound
