// The straight line from pulse numbers to the times of one clock, kept up to date frame by frame.
#pragma once

#include <cstdint>

#include "base/core/time.h"

namespace v3d {

/// A Kalman filter of two states: when the latest pulse was, and how long a period is on this
/// clock. The period starts from the nominal one with the doubt that two crystals deserve and may
/// wander slowly (temperature), so a train of any length neither drifts off nor loses its
/// precision. Instants are nanoseconds of whatever clock the caller uses throughout.
class PulseFit {
 public:
  /// `jitter`: standard deviation of one time stamp, in periods.
  PulseFit(Duration period, double jitter);

  /// `pulse` was at `instant_ns`; forgets what was before, except what was learnt of the period.
  void begin(int64_t pulse, int64_t instant_ns);
  bool begun() const { return begun_; }

  /// Which pulse was at this instant, with its fraction. Requires begun().
  double pulse_at(int64_t instant_ns) const;
  /// How many pulses lie between two instants, with their fraction.
  double periods(int64_t from_ns, int64_t to_ns) const;
  /// Standard deviation of pulse_at() so many pulses from the latest one.
  double doubt(int64_t pulse) const;

  /// `pulse` was seen at `instant_ns`. Pulses before the latest one teach nothing.
  void learn(int64_t pulse, int64_t instant_ns);

 private:
  double nominal_;          ///< ns
  double stamp_variance_;   ///< of one time stamp, ns^2
  double wander_variance_;  ///< of the period, per pulse, ns^2

  bool begun_ = false;
  int64_t pulse_ = 0;    ///< the latest
  int64_t instant_ = 0;  ///< of the latest, ns
  double rest_ = 0;      ///< of a nanosecond, to be added to instant_
  double period_;        ///< ns
  // covariance of (instant, period)
  double instant_variance_ = 0;
  double covariance_ = 0;
  double period_variance_;
};

}  // namespace v3d
