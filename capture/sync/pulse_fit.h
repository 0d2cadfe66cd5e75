// Kalman filter that maps the times of one clock to pulse numbers.
#pragma once

#include <cstdint>

#include "base/core/time.h"

namespace v3d {

/// Two states: the time of the latest pulse, and the period on this clock. The period starts at the
/// nominal value with the tolerance of two crystals (200 ppm) and may drift slowly with
/// temperature. So the precision does not depend on the length of the train. Instants are
/// nanoseconds of one clock, which the caller selects. Not thread-safe.
class PulseFit {
 public:
  /// `jitter`: standard deviation of one time stamp, in periods.
  PulseFit(Duration period, double jitter);

  /// Restarts at `pulse`, which was at `instant_ns`. Keeps only the estimate of the period.
  void begin(int64_t pulse, int64_t instant_ns);
  bool is_started() const { return started_; }

  /// The pulse number at this instant, with its fraction. Requires is_started().
  double pulse_at(int64_t instant_ns) const;
  /// Number of periods between two instants, with its fraction.
  double periods(int64_t from_ns, int64_t to_ns) const;
  /// Standard deviation of pulse_at() at the time of `pulse`, in periods.
  double stddev(int64_t pulse) const;

  /// Updates the filter: `pulse` was measured at `instant_ns`. Ignores pulses that are not later
  /// than the latest one.
  void learn(int64_t pulse, int64_t instant_ns);

 private:
  double nominal_;         ///< ns
  double stamp_variance_;  ///< of one time stamp, ns^2
  double drift_variance_;  ///< change of the period per pulse, ns^2

  bool started_ = false;
  int64_t pulse_ = 0;    ///< latest pulse
  int64_t instant_ = 0;  ///< time of the latest pulse, ns, without fraction_
  double fraction_ = 0;  ///< fraction of a nanosecond, to be added to instant_
  double period_;        ///< ns
  // Covariance matrix of (instant, period), ns^2.
  double instant_variance_ = 0;
  double covariance_ = 0;
  double period_variance_;
};

}  // namespace v3d
