#include "sound/timecode_track.h"

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <utility>

namespace v3d::sound {
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
