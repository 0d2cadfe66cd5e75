#include "sound/sample_clock.h"

#include "base/core/statistics.h"

namespace v3d::sound {

SampleClock::SampleClock(int rate_hz) : rate_hz_(rate_hz), filter_({}) {}

void SampleClock::add_stamp(int64_t samples, MonotonicInstant at) {
  if (!filter_.has_started() && offsets_.empty()) start_ = at;
  const double x = seconds(at), y = static_cast<double>(samples) / rate_hz_;
  if (is_settled_) {
    filter_.add(x, y);
    return;
  }
  offsets_.push_back(y - x);
  if (offsets_.size() < kSettling) return;
  filter_.add(x, x + upper_median(offsets_));
  offsets_.clear();
  is_settled_ = true;
}

void SampleClock::add_gap(Duration deviation) {
  if (filter_.has_started()) filter_.jump(to_seconds(deviation));
  offsets_.clear();
  is_settled_ = false;
}

double SampleClock::sample_at(MonotonicInstant at) const {
  return rate_hz_ * filter_.at(seconds(at));
}

MonotonicInstant SampleClock::instant_of(double sample) const {
  const double at_start = filter_.at(0);
  return start_ + from_seconds((sample / rate_hz_ - at_start) / (1 + filter_.drift()));
}

}  // namespace v3d::sound
