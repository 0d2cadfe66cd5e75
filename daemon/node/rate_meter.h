// Converts counters that are sampled now and then into rates.
#pragma once

#include <cstdint>
#include <map>
#include <string>

#include "base/core/time.h"

namespace v3d {

/// One thread.
class RateMeter {
 public:
  /// Counts per second since the last sample of this counter; 0 at the first sample. A sample less
  /// than 0.5 s after the last one is ignored, and the previous rate returned. A counter that has
  /// decreased was restarted from 0.
  double rate(const std::string& counter, int64_t count, MonotonicInstant now) {
    const auto [found, is_new] = samples_.try_emplace(counter, Sample{count, now, 0});
    Sample& last = found->second;
    const double seconds = to_seconds(now - last.at);
    if (is_new || seconds < kMinSeconds) return last.rate;
    const int64_t counted = count < last.count ? count : count - last.count;
    last = {count, now, static_cast<double>(counted) / seconds};
    return last.rate;
  }

 private:
  static constexpr double kMinSeconds = 0.5;
  struct Sample {
    int64_t count = 0;
    MonotonicInstant at;
    double rate = 0;
  };
  std::map<std::string, Sample> samples_;
};

}  // namespace v3d
