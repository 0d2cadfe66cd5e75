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

}  // namespace v3d::sound
