#include "capture/sync/pulse_fit.h"

#include <cmath>

namespace v3d {
namespace {

// Both as a part of the nominal period.
constexpr double kPeriodUncertainty = 200e-6;  ///< initial error: two crystals, one warm, one cold
constexpr double kPeriodDrift = 0.02e-6;       ///< change from one pulse to the next

double square(double x) { return x * x; }

/// a - b. Wraps around, because a device may send any value.
double difference(int64_t a, int64_t b) {
  return static_cast<double>(
      static_cast<int64_t>(static_cast<uint64_t>(a) - static_cast<uint64_t>(b)));
}

}  // namespace

PulseFit::PulseFit(Duration period, double jitter)
    : nominal_(static_cast<double>(period.count())),
      stamp_variance_(square(jitter * nominal_)),
      drift_variance_(square(kPeriodDrift * nominal_)),
      period_(nominal_),
      period_variance_(square(kPeriodUncertainty * nominal_)) {}

void PulseFit::begin(int64_t pulse, int64_t instant_ns) {
  started_ = true;
  pulse_ = pulse;
  instant_ = instant_ns;
  fraction_ = 0;
  instant_variance_ = stamp_variance_;
  covariance_ = 0;
}

double PulseFit::pulse_at(int64_t instant_ns) const {
  const double since = difference(instant_ns, instant_) - fraction_;
  return static_cast<double>(pulse_) + since / period_;
}

double PulseFit::periods(int64_t from_ns, int64_t to_ns) const {
  return difference(to_ns, from_ns) / period_;
}

double PulseFit::stddev(int64_t pulse) const {
  const double n = std::abs(static_cast<double>(pulse - pulse_));
  const double variance =
      instant_variance_ + 2 * n * covariance_ + n * n * period_variance_ + stamp_variance_;
  return std::sqrt(variance) / nominal_;
}

void PulseFit::learn(int64_t pulse, int64_t instant_ns) {
  if (pulse <= pulse_) return;
  const auto n = static_cast<double>(pulse - pulse_);
  // Prediction, n periods later.
  const double predicted = fraction_ + n * period_;
  instant_variance_ += 2 * n * covariance_ + n * n * period_variance_;
  covariance_ += n * period_variance_;
  period_variance_ += n * drift_variance_;
  // Correction by the measured time.
  const double innovation = difference(instant_ns, instant_) - predicted;
  const double total = instant_variance_ + stamp_variance_;
  const double instant_gain = instant_variance_ / total;
  const double period_gain = covariance_ / total;
  const double corrected = predicted + instant_gain * innovation;
  period_ += period_gain * innovation;
  period_variance_ -= period_gain * covariance_;
  covariance_ *= 1 - instant_gain;
  instant_variance_ *= 1 - instant_gain;
  // instant_ is an integer and fraction_ below 1, so precision does not depend on the train's
  // length.
  const double whole = std::floor(corrected);
  instant_ += static_cast<int64_t>(whole);
  fraction_ = corrected - whole;
  pulse_ = pulse;
}

}  // namespace v3d
