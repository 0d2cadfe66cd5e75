#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

#include <algorithm>
#include <vector>

#include "trigger/paced_train.h"

namespace v3d::trigger {
namespace {

TEST(Lateness, is_zero_without_pulses) {
  const PulseStatistics none = Lateness(Duration(5)).statistics();
  EXPECT_EQ(none.jitter_p50 + none.jitter_p99 + none.jitter_max, Duration(0));
  EXPECT_EQ(none.late, 0);
}

RC_GTEST_PROP(Lateness, reports_percentiles_within_10_percent_and_maximum_and_count_exactly, ()) {
  auto ns = *rc::gen::nonEmpty(
      rc::gen::container<std::vector<int64_t>>(rc::gen::inRange<int64_t>(-5, 2'000'000'000)));
  Lateness lateness(Duration(1'000'000));
  for (const int64_t n : ns) lateness.add(Duration(n));
  for (int64_t& n : ns) n = std::max<int64_t>(n, 0);
  std::sort(ns.begin(), ns.end());
  const PulseStatistics reported = lateness.statistics();
  const auto within = [&](Duration percentile, double share) {
    const auto rank = static_cast<size_t>(std::ceil(share * static_cast<double>(ns.size())));
    const int64_t exact = ns[rank - 1];
    RC_ASSERT(percentile.count() >= exact);
    RC_ASSERT(static_cast<double>(percentile.count()) <= 1.1 * static_cast<double>(exact) + 2);
  };
  within(reported.jitter_p50, 0.5);
  within(reported.jitter_p99, 0.99);
  RC_ASSERT(reported.jitter_max.count() == ns.back());
  RC_ASSERT(reported.late ==
            std::count_if(ns.begin(), ns.end(), [](int64_t n) { return n > 1'000'000; }));
}

}  // namespace
}  // namespace v3d::trigger
