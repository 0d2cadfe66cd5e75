#include <gtest/gtest.h>

#include <limits>

#include "base/config/studio_values.h"

namespace v3d {
namespace {

using namespace std::chrono_literals;

MonotonicInstant at(Duration since_start) { return MonotonicInstant(1000s + since_start); }

TEST(PlausiblePulses, are_a_limited_number_ahead_of_the_newest_one) {
  PlausiblePulses pulses(100);
  EXPECT_TRUE(pulses.contains(1'000'000, at(0s))) << "the first may be any";
  pulses.add(40, at(0s));
  EXPECT_TRUE(pulses.contains(140, at(0s)));
  EXPECT_FALSE(pulses.contains(141, at(0s)));
  EXPECT_TRUE(pulses.contains(0, at(0s))) << "late, but plausible";
  EXPECT_FALSE(pulses.contains(-1, at(0s)));
  EXPECT_FALSE(pulses.contains(std::numeric_limits<int64_t>::max(), at(1s)));
}

TEST(PlausiblePulses, may_come_at_the_highest_rate_since_the_newest_one) {
  PlausiblePulses pulses(100);
  pulses.add(40, at(0s));
  pulses.add(7, at(50s));  // late: the newest one remains 40
  EXPECT_TRUE(pulses.contains(140 + 60'000, at(60s)));
  EXPECT_FALSE(pulses.contains(141 + 60'000, at(60s)));
  pulses.add(60'000, at(60s));
  EXPECT_FALSE(pulses.contains(60'101, at(60s)));
}

}  // namespace
}  // namespace v3d
