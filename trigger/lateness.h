// Lateness statistics of a pulse train: a histogram of constant size. The percentiles of
// base/core/statistics.h need all values; a train of days at 1000 Hz has too many, and the thread
// that adds them must not allocate.
#pragma once

#include <array>
#include <cstdint>

#include "trigger/pulse_generator.h"

namespace v3d {

/// Not thread-safe.
class Lateness {
 public:
  /// A pulse that is later than `threshold` is counted as late.
  explicit Lateness(Duration threshold = {}) : threshold_(threshold) {}
  /// A negative value counts as 0.
  void add(Duration lateness);
  PulseStatistics statistics() const;
  Duration max() const { return max_; }

 private:
  /// The smallest value that at least the fraction `share` of all values do not exceed. It is
  /// rounded up to the end of its bucket.
  Duration percentile(double share) const;

  static constexpr int kPerOctave = 8;  ///< buckets per doubling
  Duration threshold_;
  Duration max_{};
  int64_t count_ = 0;
  int64_t late_count_ = 0;
  std::array<int64_t, 63 * kPerOctave> buckets_{};  ///< nanoseconds, logarithmic scale
};

}  // namespace v3d
