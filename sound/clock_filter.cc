#include "sound/clock_filter.h"

#include <algorithm>
#include <cmath>

#include "base/core/statistics.h"

namespace v3d::sound {
namespace {

/// Innovations beyond this many standard deviations are outliers.
constexpr double kGate = 4;
/// Weight of a new innovation in the estimate of the noise.
constexpr double kNoiseGain = 0.02;

}  // namespace

bool ClockFilter::add(double x, double y) {
  if (!started_) {
    started_ = true;
    x_ = x;
    phase_ = y - x;
    p00_ = pair_ * pair_;
    p11_ = noise_.drift * noise_.drift;
    return true;
  }
  predict(x);
  const double innovation = y - x - phase_;
  const double deviation = std::sqrt(p00_ + pair_ * pair_);
  if (std::abs(innovation) > kGate * deviation && ++rejected_ <= kMaxRejected) return false;
  if (rejected_ > kMaxRejected) p00_ = std::max(p00_, innovation * innovation);
  rejected_ = 0;
  follow(innovation);
  return true;
}

void ClockFilter::jump(double deviation) {
  p00_ += deviation * deviation;
  rejected_ = 0;
}

double ClockFilter::deviation_at(double x) const {
  const double dt = x - x_;
  return std::sqrt(p00_ + 2 * dt * p01_ + dt * dt * p11_ + noise_.phase_walk * std::abs(dt));
}

void ClockFilter::predict(double x) {
  const double dt = std::max(0.0, x - x_);
  phase_ += drift_ * dt;
  p00_ += 2 * dt * p01_ + dt * dt * p11_ + noise_.phase_walk * dt +
          noise_.drift_walk * dt * dt * dt / 3;
  p01_ += dt * p11_ + noise_.drift_walk * dt * dt / 2;
  p11_ += noise_.drift_walk * dt;
  x_ = x;
}

void ClockFilter::follow(double innovation) {
  const double variance = p00_ + pair_ * pair_;
  // Only innovations that are mostly noise tell about it.
  if (p00_ < pair_ * pair_) {
    const double noise = std::max(0.0, innovation * innovation - p00_);
    const double smoothed = (1 - kNoiseGain) * pair_ * pair_ + kNoiseGain * noise;
    pair_ = std::max(noise_.min_pair, std::sqrt(smoothed));
  }
  const double k0 = p00_ / variance, k1 = p01_ / variance;
  phase_ += k0 * innovation;
  drift_ += k1 * innovation;
  p11_ -= k1 * p01_;
  p01_ *= 1 - k0;
  p00_ *= 1 - k0;
}

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
