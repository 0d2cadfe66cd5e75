#include "capture/sync/pulse_times.h"

#include <algorithm>
#include <cmath>

namespace v3d {
namespace {

constexpr size_t kMaxPulses = 256;

int64_t whole_periods(Duration d, Duration period) {
  return std::llround(static_cast<double>(d.count()) / static_cast<double>(period.count()));
}

}  // namespace

void PulseTimes::begin(Duration period) {
  const std::lock_guard lock(mutex_);
  period_ = period;
  running_ = true;
  ++trains_;
  pulses_.clear();
}

void PulseTimes::end() {
  const std::lock_guard lock(mutex_);
  running_ = false;
}

void PulseTimes::add(int64_t pulse, MonotonicInstant at) {
  const std::lock_guard lock(mutex_);
  pulses_.push_back({pulse, at});
  if (pulses_.size() > kMaxPulses) pulses_.pop_front();
}

int64_t PulseTimes::trains() const {
  const std::lock_guard lock(mutex_);
  return trains_;
}

Duration PulseTimes::period() const {
  const std::lock_guard lock(mutex_);
  return period_;
}

const PulseTimes::Pulse& PulseTimes::nearest_to(MonotonicInstant at) const {
  const auto after = std::upper_bound(pulses_.begin(), pulses_.end(), at,
                                      [](MonotonicInstant t, const Pulse& p) { return t < p.at; });
  if (after == pulses_.begin()) return pulses_.front();
  if (after == pulses_.end()) return pulses_.back();
  const auto before = std::prev(after);
  return at - before->at <= after->at - at ? *before : *after;
}

std::optional<NearestPulse> PulseTimes::find(MonotonicInstant at, std::optional<Duration> before,
                                             MonotonicInstant now) const {
  const std::lock_guard lock(mutex_);
  if (!running_) return NearestPulse{};
  const bool all_known = now - at > period_ / 2 + kMaxSenseDelay;
  if (pulses_.empty()) return all_known ? std::optional(NearestPulse{}) : std::nullopt;

  const Pulse& nearest = nearest_to(at);
  Duration phase = at - nearest.at;
  int64_t periods = whole_periods(phase, period_);
  phase -= periods * period_;
  const int64_t shift = before ? whole_periods(phase - *before, period_) : 0;
  const bool keeps_phase =
      before && std::abs((phase - shift * period_).count()) <= period_.count() * 6 / 10;
  if (keeps_phase) {
    periods += shift;
    phase -= shift * period_;
  }
  const Pulse& last = pulses_.back();
  const int64_t pulse = nearest.number + periods;
  const bool certain = last.at > at || keeps_phase || phase < period_ * 4 / 10;
  if (!all_known && (pulse > last.number || !certain)) return std::nullopt;
  if (pulse < 0 || pulse > last.number) return NearestPulse{};
  return NearestPulse{.pulse = pulse, .phase = phase};
}

}  // namespace v3d
