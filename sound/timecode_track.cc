#include "sound/timecode_track.h"

#include <algorithm>
#include <cmath>

namespace v3d::sound {

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
  if (!is_valid(frame.timecode, *rate_)) {
    ++jumps_;
    return;
  }
  const int64_t number = frame_number(frame.timecode, *rate_);
  if (!runs_.empty()) {
    TimecodeRun& run = runs_.back();
    const int64_t step = frame.is_reverse ? -1 : 1;
    const int64_t day = frames_per_day(*rate_);
    const bool follows = ((run.last_frame + step) % day + day) % day == number;
    if (follows && run.last_frame + step == number) {
      run.last_frame = number;
      run.last_sample = static_cast<double>(frame.sample);
      return;
    }
    if (!follows) ++jumps_;  // midnight starts a run, too, but is no jump
  }
  if (runs_.size() < kMaxRuns) {
    const auto sample = static_cast<double>(frame.sample);
    runs_.push_back({sample, number, sample, number});
  }
}

std::optional<Timecode> TimecodeTrack::at(double sample) const {
  if (!rate_) return std::nullopt;
  const auto frames = timecode_frames_at(runs_, *rate_, rate_hz_, sample);
  if (!frames) return std::nullopt;
  return timecode_of(std::llround(std::floor(*frames)), *rate_);
}

}  // namespace v3d::sound
