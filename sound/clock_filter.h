// Relations of clocks: their Kalman filter, and the sample clock of a sound device.
#pragma once

#include <cstdint>
#include <vector>

#include "base/core/time.h"

namespace v3d::sound {

/// Estimates the time of one clock, y, as a function of the time of another, x, both in seconds,
/// from noisy pairs (x, y).
///
/// The state is y - x and its rate of change, the drift. Both follow a random walk, as those of
/// crystal oscillators do. The noise of the pairs is estimated from the innovations. Pairs far
/// outside of it are rejected; when more than kMaxRejected in a row are, the clock has jumped, and
/// the filter follows it. Source: Galleani and Tavella, "Time and the Kalman filter", IEEE Control
/// Systems Magazine 30(2), 2010. One thread.
class ClockFilter {
 public:
  struct Noise {
    double pair = 1e-3;         ///< initial standard deviation of a pair, s
    double min_pair = 5e-6;     ///< least standard deviation of a pair, s
    double drift = 300e-6;      ///< standard deviation of the drift before the first pair, s/s
    double phase_walk = 1e-14;  ///< variance of the random walk of y - x, s²/s
    double drift_walk = 1e-14;  ///< variance of the random walk of the drift, 1/s
  };
  static constexpr int kMaxRejected = 25;

  explicit ClockFilter(const Noise& noise) : noise_(noise), pair_(noise.pair) {}

  bool has_started() const { return started_; }
  /// Adds a pair. x must not descend. False when the pair was rejected.
  bool add(double x, double y);
  /// The y of later pairs has jumped by an unknown amount with this standard deviation, s.
  void jump(double deviation);

  /// The estimate of y at x, at or after the last pair. Requires has_started().
  double at(double x) const { return x + phase_ + drift_ * (x - x_); }
  /// Standard deviation of at(x), s.
  double deviation_at(double x) const;
  /// Drift of y against x, s/s.
  double drift() const { return drift_; }
  /// Standard deviation of a pair, s, as estimated.
  double pair_deviation() const { return pair_; }

 private:
  void predict(double x);
  void follow(double innovation);

  Noise noise_;
  double pair_;
  bool started_ = false;
  int rejected_ = 0;
  double x_ = 0;
  double phase_ = 0, drift_ = 0;
  double p00_ = 0, p01_ = 0, p11_ = 0;  ///< covariance of phase_ and drift_
};

// Relation of a sound device's sample clock to the clock of its host.

/// Follows the sample clock by the time stamps of the blocks that the device delivers. Drift,
/// jitter, late stamps and jumps: see ClockFilter. One thread.
class SampleClock {
 public:
  explicit SampleClock(int rate_hz);

  /// The device had recorded `samples` samples at `at`. Neither may descend.
  void add_stamp(int64_t samples, MonotonicInstant at);
  /// Samples were lost; their estimated number is in error by this standard deviation.
  void add_gap(Duration deviation);

  /// False at the start and after a gap, until kSettling stamps have come: the median of their
  /// offsets is then the first pair, because single stamps may be late by milliseconds.
  bool is_known() const { return is_settled_; }
  /// True from the first settling on: after a gap, sample_at() is right to the deviation of the
  /// gap.
  bool has_estimate() const { return filter_.has_started(); }
  /// The position that was recorded at an instant. Requires has_estimate().
  double sample_at(MonotonicInstant at) const;
  /// The inverse.
  MonotonicInstant instant_of(double sample) const;
  /// Drift of the sample clock against the host's clock, 1e-6; positive where it is fast.
  double drift_ppm() const { return 1e6 * filter_.drift(); }
  /// Standard deviation of a time stamp, s.
  double stamp_deviation() const { return filter_.pair_deviation(); }

 private:
  static constexpr size_t kSettling = 8;

  double seconds(MonotonicInstant at) const { return to_seconds(at - start_); }

  const double rate_hz_;
  MonotonicInstant start_;
  ClockFilter filter_;
  bool is_settled_ = false;
  std::vector<double> offsets_;  ///< of the stamps since the start or the gap, s
};

}  // namespace v3d::sound
