// How late pulses were: a tally of fixed size, however long the train.
#pragma once

#include <array>
#include <cstdint>

#include "trigger/pulse_generator.h"

namespace v3d {

/// One thread.
class Lateness {
 public:
  /// A pulse later than `late` is counted as late.
  explicit Lateness(Duration late = {}) : late_(late) {}
  /// Negative counts as 0.
  void add(Duration lateness);
  PulseStatistics statistics() const;
  Duration most() const { return most_; }

 private:
  /// The least value that at least `share` of all do not exceed, rounded up to its bucket's end.
  Duration percentile(double share) const;

  static constexpr int kPerOctave = 8;
  Duration late_;
  Duration most_{};
  int64_t count_ = 0;
  int64_t late_count_ = 0;
  std::array<int64_t, 63 * kPerOctave> buckets_{};  ///< of nanoseconds, on a logarithmic scale
};

}  // namespace v3d
