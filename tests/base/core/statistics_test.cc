#include "base/core/statistics.h"

#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

namespace v3d {
namespace {

using Values = std::vector<double>;

TEST(Statistics, percentile_returns_one_of_the_values) {
  EXPECT_EQ(percentile<double>({3, 1, 2, 4}, 0.50), 2);
  EXPECT_EQ(percentile<double>({3, 1, 2, 4}, 0.51), 3);
  EXPECT_EQ(percentile<double>({3, 1, 2, 4}, 0.99), 4);
  EXPECT_EQ(percentile<double>({3, 1, 2, 4}, 0), 1);
  EXPECT_EQ(percentile<double>({7}, 0.5), 7);
  EXPECT_EQ(percentile<double>({}, 0.5), 0);
}

RC_GTEST_PROP(Statistics, percentile_is_the_smallest_value_that_the_share_does_not_exceed, ()) {
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

TEST(Statistics, median_of_an_even_number_is_the_mean_of_the_middle_values) {
  EXPECT_EQ(median({4, 1, 3, 2}), 2.5);
  EXPECT_EQ(median({5, 1, 3}), 3);
  EXPECT_EQ(median({}), 0);
}

TEST(Statistics, upper_median_of_an_even_number_is_the_larger_middle_value) {
  EXPECT_EQ(upper_median<double>({4, 1, 3, 2}), 3);
  EXPECT_EQ(upper_median<double>({5, 1, 3}), 3);
  EXPECT_EQ(upper_median<float>({}), 0);
}

TEST(Statistics, mean_of_no_values_is_0) {
  EXPECT_EQ(mean({1, 2, 6}), 3);
  EXPECT_EQ(mean({}), 0);
}

}  // namespace
}  // namespace v3d
