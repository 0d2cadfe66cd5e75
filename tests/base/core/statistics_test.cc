#include "base/core/statistics.h"

#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

namespace v3d {
namespace {

using Values = std::vector<double>;

TEST(Statistics, percentiles_are_values_that_occurred) {
  EXPECT_EQ(percentile<double>({3, 1, 2, 4}, 0.50), 2);
  EXPECT_EQ(percentile<double>({3, 1, 2, 4}, 0.51), 3);
  EXPECT_EQ(percentile<double>({3, 1, 2, 4}, 0.99), 4);
  EXPECT_EQ(percentile<double>({3, 1, 2, 4}, 0), 1);
  EXPECT_EQ(percentile<double>({7}, 0.5), 7);
  EXPECT_EQ(percentile<double>({}, 0.5), 0);
}

RC_GTEST_PROP(Statistics, a_percentile_is_the_least_value_that_such_a_share_does_not_exceed, ()) {
  const auto values = *rc::gen::nonEmpty<std::vector<int>>();
  const int hundredths = *rc::gen::inRange(1, 101);
  const int found = percentile(values, hundredths / 100.0);
  RC_ASSERT(std::count(values.begin(), values.end(), found) > 0);
  const auto share_up_to = [&](auto within) {
    return 100 * std::count_if(values.begin(), values.end(), within) / std::ssize(values);
  };
  RC_ASSERT(share_up_to([&](int v) { return v <= found; }) >= hundredths);
  RC_ASSERT(share_up_to([&](int v) { return v < found; }) <= hundredths);
}

TEST(Statistics, the_median_of_an_even_number_lies_in_the_middle_of_two) {
  EXPECT_EQ(median({4, 1, 3, 2}), 2.5);
  EXPECT_EQ(median({5, 1, 3}), 3);
  EXPECT_EQ(median({}), 0);
}

TEST(Statistics, the_upper_median_is_the_upper_one_of_the_two) {
  EXPECT_EQ(upper_median<double>({4, 1, 3, 2}), 3);
  EXPECT_EQ(upper_median<double>({5, 1, 3}), 3);
  EXPECT_EQ(upper_median<float>({}), 0);
}

TEST(Statistics, the_mean_of_nothing_is_0) {
  EXPECT_EQ(mean({1, 2, 6}), 3);
  EXPECT_EQ(mean({}), 0);
}

}  // namespace
}  // namespace v3d
