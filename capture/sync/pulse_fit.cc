#include "capture/sync/pulse_fit.h"

#include <cmath>

namespace v3d {
namespace {

constexpr double kPeriodDoubt =
    200e-6;                          ///< of the nominal period: two crystals, one warm, one cold
constexpr double kWander = 0.02e-6;  ///< of the period, from one pulse to the next

double square(double x) { return x * x; }

/// A device may say anything, so differences wrap.
double difference(int64_t a, int64_t b) {
  return static_cast<double>(
      static_cast<int64_t>(static_cast<uint64_t>(a) - static_cast<uint64_t>(b)));
}

}  // namespace

PulseFit::PulseFit(Duration period, double jitter)
    : nominal_(static_cast<double>(period.count())),
      stamp_variance_(square(jitter * nominal_)),
      wander_variance_(square(kWander * nominal_)),
      period_(nominal_),
      period_variance_(square(kPeriodDoubt * nominal_)) {}

void PulseFit::begin(int64_t pulse, int64_t instant_ns) {
  begun_ = true;
  pulse_ = pulse;
  instant_ = instant_ns;
  rest_ = 0;
  instant_variance_ = stamp_variance_;
  covariance_ = 0;
}

double PulseFit::pulse_at(int64_t instant_ns) const {
  const double since = difference(instant_ns, instant_) - rest_;
  return static_cast<double>(pulse_) + since / period_;
}

double PulseFit::periods(int64_t from_ns, int64_t to_ns) const {
  return difference(to_ns, from_ns) / period_;
}

double PulseFit::doubt(int64_t pulse) const {
  const double n = std::abs(static_cast<double>(pulse - pulse_));
  const double variance =
      instant_variance_ + 2 * n * covariance_ + n * n * period_variance_ + stamp_variance_;
  return std::sqrt(variance) / nominal_;
}

void PulseFit::learn(int64_t pulse, int64_t instant_ns) {
  if (pulse <= pulse_) return;
  const auto n = static_cast<double>(pulse - pulse_);
  // Predict: n periods later.
  const double ahead = rest_ + n * period_;
  instant_variance_ += 2 * n * covariance_ + n * n * period_variance_;
  covariance_ += n * period_variance_;
  period_variance_ += n * wander_variance_;
  // Correct by what was seen.
  const double surprise = difference(instant_ns, instant_) - ahead;
  const double total = instant_variance_ + stamp_variance_;
  const double instant_gain = instant_variance_ / total;
  const double period_gain = covariance_ / total;
  const double now = ahead + instant_gain * surprise;
  period_ += period_gain * surprise;
  period_variance_ -= period_gain * covariance_;
  covariance_ *= 1 - instant_gain;
  instant_variance_ *= 1 - instant_gain;
  // The instant stays whole nanoseconds, so that no number grows with the length of the train.
  const double whole = std::floor(now);
  instant_ += static_cast<int64_t>(whole);
  rest_ = now - whole;
  pulse_ = pulse;
}

}  // namespace v3d
