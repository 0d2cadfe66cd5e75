#include "sound/timecode_clock.h"

#include <algorithm>
#include <cmath>

namespace v3d::sound {

TimecodeClock::TimecodeClock(TimecodeRate rate, double frames, MonotonicInstant at)
    : rate_(rate), frames_(frames), start_(at) {}

void TimecodeClock::begin_train(double pulse_rate_hz) {
  pulse_rate_hz_ = pulse_rate_hz;
  awaits_train_ = true;
}

void TimecodeClock::add_pulse(int64_t pulse, MonotonicInstant at) {
  if (awaits_train_) {
    train_ = Train{.first_pulse = pulse, .first = at, .last = at, .offset = offset_at(at)};
    awaits_train_ = false;
  }
  if (!train_ || at < train_->last) return;
  const auto periods = static_cast<double>(pulse - train_->first_pulse);
  train_->pulses.add(to_seconds(at - train_->first), periods / pulse_rate_hz_);
  train_->last = at;
}

double TimecodeClock::offset_in_train(MonotonicInstant at) const {
  const double x = to_seconds(at - train_->first);
  const double end = to_seconds(train_->last - train_->first);
  if (x >= end) return train_->offset + train_->pulses.at(x) - x;
  // Before the last pulse the filter would extend its present drift backwards. A line from the
  // first pulse, where the offset is known, is exact at both ends.
  return train_->offset + x / end * (train_->pulses.at(end) - end);
}

double TimecodeClock::offset_at(MonotonicInstant at) const {
  if (!train_) return 0;
  const MonotonicInstant end = train_->last + kTrainEnd;
  if (at <= end) return offset_in_train(at);
  const double offset = offset_in_train(end);
  const double left = std::max(0.0, std::abs(offset) - kMaxSlew * to_seconds(at - end));
  return std::copysign(left, offset);
}

double TimecodeClock::frames_at(MonotonicInstant at) const {
  return frames_ + frames_per_second(rate_) * (to_seconds(at - start_) + offset_at(at));
}

namespace {

constexpr double kSilenceSeconds = 0.01;
/// A larger distance from the clock is not corrected by the lengths of frames, frames.
constexpr double kMaxError = 0.5;
/// An underrun has an unknown length.
constexpr Duration kUnderrunDeviation = std::chrono::seconds(10);

}  // namespace

LtcPlayer::LtcPlayer(int rate_hz, TimecodeRate rate)
    : rate_hz_(rate_hz), rate_(rate), device_(rate_hz) {}

void LtcPlayer::add_underrun() { device_.add_gap(kUnderrunDeviation); }

std::vector<float> LtcPlayer::next(int64_t count, const TimecodeClock& clock) {
  while (std::ssize(buffer_) < count) append_frame(clock);
  std::vector<float> samples(buffer_.begin(), buffer_.begin() + count);
  buffer_.erase(buffer_.begin(), buffer_.begin() + count);
  return samples;
}

void LtcPlayer::append_silence(double samples) {
  const auto count = std::max<int64_t>(1, std::llround(samples));
  buffer_.resize(buffer_.size() + static_cast<size_t>(count));
  position_ += count;
}

void LtcPlayer::append_frame(const TimecodeClock& clock) {
  if (!device_.is_known()) {
    writer_.reset();
    return append_silence(kSilenceSeconds * rate_hz_);
  }
  const double now = clock.frames_at(device_.instant_of(static_cast<double>(position_)));
  const double to_go = static_cast<double>(next_frame_ + 1) - now;
  if (!writer_ || std::abs(to_go - 1) > kMaxError) {
    next_frame_ = std::llround(std::ceil(now));
    writer_.emplace(rate_hz_, rate_, timecode_of(next_frame_, rate_));
    const double wait = static_cast<double>(next_frame_) - now;
    return append_silence(wait * rate_hz_ / frames_per_second(rate_));
  }
  const double drift = 1 + 1e-6 * device_.drift_ppm();
  const auto samples = writer_->next(std::clamp(to_go * drift, 1 - kMaxStretch, 1 + kMaxStretch));
  buffer_.insert(buffer_.end(), samples.begin(), samples.end());
  position_ += std::ssize(samples);
  ++next_frame_;
}

}  // namespace v3d::sound
