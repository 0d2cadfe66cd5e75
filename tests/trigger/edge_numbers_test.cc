#include "trigger/edge_numbers.h"

#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

namespace v3d {
namespace {

using std::chrono::milliseconds;

MonotonicInstant at(Duration t) { return MonotonicInstant(std::chrono::seconds(9) + t); }

TEST(EdgeNumbers, leave_out_the_pulses_that_have_no_edge) {
  EdgeNumbers numbers(milliseconds(40));
  EXPECT_EQ(numbers.number(at(milliseconds(0))), 0);
  EXPECT_EQ(numbers.number(at(milliseconds(40))), 1);
  EXPECT_EQ(numbers.number(at(milliseconds(160))), 4);
  EXPECT_EQ(numbers.number(at(milliseconds(200))), 5);
}

TEST(EdgeNumbers, rise_even_when_edges_come_too_close) {
  EdgeNumbers numbers(milliseconds(40));
  EXPECT_EQ(numbers.number(at(milliseconds(0))), 0);
  EXPECT_EQ(numbers.number(at(milliseconds(1))), 1);
  EXPECT_EQ(numbers.number(at(milliseconds(1))), 2);
}

/// A clock that runs 200 ppm wrong and edges that jitter by a quarter of a period.
RC_GTEST_PROP(EdgeNumbers, follow_a_jittering_train_with_gaps_for_an_hour, ()) {
  const Duration period = milliseconds(40);
  const Duration true_period = std::chrono::microseconds(40'008);
  EdgeNumbers numbers(period);
  RC_ASSERT(numbers.number(at({})) == 0);
  int64_t pulse = 0;
  for (const int gap : *rc::gen::container<std::vector<int>>(rc::gen::inRange(1, 100))) {
    pulse += gap;
    const Duration jitter = *rc::gen::inRange(-5, 5) * milliseconds(1);
    RC_ASSERT(numbers.number(at(pulse * true_period + jitter)) == pulse);
  }
}

}  // namespace
}  // namespace v3d
