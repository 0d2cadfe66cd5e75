#include <gtest/gtest.h>

#include <cmath>

#include "base/config/studio_values.h"

namespace v3d {
namespace {

TEST(PulseRate, accepts_the_range_with_both_limits) {
  for (const double rate : {0.01, 0.1, 25.0, 1000.0}) EXPECT_TRUE(is_pulse_rate(rate)) << rate;
  for (const double rate : {-25.0, 0.0, 0.0099, 1000.1, std::nan(""), HUGE_VAL}) {
    EXPECT_FALSE(is_pulse_rate(rate)) << rate;
  }
}

TEST(PulseRate, error_message_contains_the_range) {
  EXPECT_EQ(pulse_rate_error(5000),
            "a pulse rate of 5000 Hz is not possible; expected 0.01 to 1000 Hz");
}

}  // namespace
}  // namespace v3d
