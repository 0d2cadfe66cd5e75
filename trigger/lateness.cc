#include "trigger/lateness.h"

#include <algorithm>
#include <cmath>

namespace v3d {

void Lateness::add(Duration lateness) {
  lateness = std::max(lateness, Duration::zero());
  const double bucket = kPerOctave * std::log2(static_cast<double>(lateness.count()) + 1);
  ++buckets_[std::min(buckets_.size() - 1, static_cast<size_t>(bucket))];
  ++count_;
  late_count_ += lateness > threshold_ ? 1 : 0;
  max_ = std::max(max_, lateness);
}

Duration Lateness::percentile(double share) const {
  const auto wanted = static_cast<int64_t>(std::ceil(share * static_cast<double>(count_)));
  int64_t passed = 0;
  for (size_t i = 0; i < buckets_.size(); ++i) {
    passed += buckets_[i];
    if (passed < wanted || passed == 0) continue;
    const double end = std::exp2(static_cast<double>(i + 1) / kPerOctave);
    return std::min(max_, Duration(static_cast<int64_t>(end)));
  }
  return {};
}

PulseStatistics Lateness::statistics() const {
  return {.jitter_p50 = percentile(0.5),
          .jitter_p99 = percentile(0.99),
          .jitter_max = max_,
          .late = late_count_};
}

}  // namespace v3d
