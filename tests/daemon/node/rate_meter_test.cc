#include "daemon/node/rate_meter.h"

#include <gtest/gtest.h>

namespace v3d {
namespace {

MonotonicInstant at(double seconds) { return MonotonicInstant() + from_seconds(seconds); }

TEST(RateMeter, counts_per_second_between_looks) {
  RateMeter meter;
  EXPECT_EQ(meter.rate("cam01", 1000, at(0)), 0) << "nothing to compare with";
  EXPECT_DOUBLE_EQ(meter.rate("cam01", 1050, at(2)), 25);
  EXPECT_DOUBLE_EQ(meter.rate("cam02", 7, at(2)), 0) << "every counter for itself";
}

TEST(RateMeter, keeps_the_rate_when_it_is_looked_at_twice_in_a_moment) {
  RateMeter meter;
  meter.rate("cam01", 0, at(0));
  EXPECT_DOUBLE_EQ(meter.rate("cam01", 25, at(1)), 25);
  EXPECT_DOUBLE_EQ(meter.rate("cam01", 26, at(1.02)), 25);
  EXPECT_DOUBLE_EQ(meter.rate("cam01", 50, at(2)), 25) << "nothing was forgotten";
}

TEST(RateMeter, takes_a_counter_that_went_back_as_begun_anew) {
  RateMeter meter;
  meter.rate("cam01", 1250, at(0));
  EXPECT_DOUBLE_EQ(meter.rate("cam01", 10, at(1)), 10);
}

}  // namespace
}  // namespace v3d
