// Relation of a sound device's sample clock to the clock of its host.
#pragma once

#include <cstdint>
#include <vector>

#include "base/core/time.h"
#include "sound/clock_filter.h"

namespace v3d::sound {

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
