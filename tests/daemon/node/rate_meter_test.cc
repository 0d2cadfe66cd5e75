#include <gtest/gtest.h>

#include "daemon/captured/camera_monitor.h"

namespace v3d::node {
namespace {

MonotonicInstant at(double seconds) { return MonotonicInstant() + from_seconds(seconds); }

TEST(RateMeter, counts_per_second_between_samples) {
  captured::RateMeter meter;
  EXPECT_EQ(meter.rate("cam01", 1000, at(0)), 0) << "nothing to compare with";
  EXPECT_DOUBLE_EQ(meter.rate("cam01", 1050, at(2)), 25);
  EXPECT_DOUBLE_EQ(meter.rate("cam02", 7, at(2)), 0) << "counters are independent";
}

TEST(RateMeter, keeps_the_rate_when_sampled_twice_within_half_a_second) {
  captured::RateMeter meter;
  meter.rate("cam01", 0, at(0));
  EXPECT_DOUBLE_EQ(meter.rate("cam01", 25, at(1)), 25);
  EXPECT_DOUBLE_EQ(meter.rate("cam01", 26, at(1.02)), 25);
  EXPECT_DOUBLE_EQ(meter.rate("cam01", 50, at(2)), 25) << "of the whole second";
}

TEST(RateMeter, treats_a_decreased_counter_as_restarted) {
  captured::RateMeter meter;
  meter.rate("cam01", 1250, at(0));
  EXPECT_DOUBLE_EQ(meter.rate("cam01", 10, at(1)), 10);
}

}  // namespace
}  // namespace v3d::node
