// How fast counters count, for those who look at them now and then.
#pragma once

#include <cstdint>
#include <map>
#include <string>

#include "base/time.h"

namespace v3d {

/// One thread.
class RateMeter {
 public:
  /// Counts per second since the last look at this counter; 0 at the first. Looks that follow each
  /// other too closely to tell give the rate of before. A counter that went back has begun anew.
  double rate(const std::string& counter, int64_t count, MonotonicInstant now) {
    const auto [found, is_new] = looks_.try_emplace(counter, Look{count, now, 0});
    Look& last = found->second;
    const double seconds = to_seconds(now - last.at);
    if (is_new || seconds < kShortest) return last.rate;
    const int64_t counted = count < last.count ? count : count - last.count;
    last = {count, now, static_cast<double>(counted) / seconds};
    return last.rate;
  }

 private:
  static constexpr double kShortest = 0.5;  // seconds
  struct Look {
    int64_t count = 0;
    MonotonicInstant at;
    double rate = 0;
  };
  std::map<std::string, Look> looks_;
};

}  // namespace v3d
