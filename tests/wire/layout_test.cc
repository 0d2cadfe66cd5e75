#include <gtest/gtest.h>

#include <vector>

#include "wire/packing.h"

namespace v3d::wire {
namespace {

using Body = std::vector<uint8_t>;

TEST(Layout, accepts_exactly_its_fields) {
  EXPECT_TRUE(fits("qib", Body(13)));
  EXPECT_FALSE(fits("qib", Body(12)));
  EXPECT_FALSE(fits("qib", Body(14)));
}

TEST(Layout, accepts_strings_that_end_with_their_only_nul) {
  EXPECT_TRUE(fits("s", Body{0, 0, 0, 3, 'a', 'b', 0}));
  EXPECT_TRUE(fits("s", Body{0, 0, 0, 1, 0}));
  EXPECT_FALSE(fits("s", Body{0, 0, 0, 0}));
  EXPECT_FALSE(fits("s", Body{0, 0, 0, 3, 'a', 'b', 'c'}));
  EXPECT_FALSE(fits("s", Body{0, 0, 0, 3, 'a', 0, 0}));
  EXPECT_FALSE(fits("s", Body{0xff, 0xff, 0xff, 0xff, 'a', 0}));
  EXPECT_FALSE(fits("s", Body{0, 0, 0, 9, 'a', 0}));
}

TEST(Layout, accepts_booleans_of_0_or_1) {
  EXPECT_TRUE(fits("?", Body{1}));
  EXPECT_FALSE(fits("?", Body{2}));
}

TEST(Layout, checks_the_number_of_elements_of_arrays) {
  EXPECT_TRUE(fits("nB0", Body{0, 0, 0, 2, 7, 7}));
  EXPECT_FALSE(fits("nB0", Body{0, 0, 0, 3, 7, 7}));
  EXPECT_FALSE(fits("nB0", Body{0x80, 0, 0, 0}));
  EXPECT_TRUE(fits("nS0", Body{0, 0, 0, 1, 0, 0, 0, 1, 0}));
  EXPECT_FALSE(fits("nS0", Body{0x7f, 0, 0, 0, 0, 0, 0, 1, 0}));
  EXPECT_TRUE(fits("nD0", Body{0, 0, 0, 1, 0, 0, 0, 0, 0, 0, 0, 0}));
  EXPECT_FALSE(fits("nD0", Body{0x20, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0}));
}

TEST(Layout, distinguishes_two_counts) {
  EXPECT_TRUE(fits("nnB1B0", Body{0, 0, 0, 0, 0, 0, 0, 1, 9}));
  EXPECT_EQ(bytes_before_arrays("nnB1B0", Body{0, 0, 0, 0, 0, 0, 0, 1, 9}), 8U);
  EXPECT_EQ(bytes_before_arrays("nnB1B0", Body{0, 0, 0, 0, 0, 0, 0}), std::nullopt);
}

}  // namespace
}  // namespace v3d::wire
