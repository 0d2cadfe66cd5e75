#include <gtest/gtest.h>

#include "base/core/error.h"
#include "base/core/text.h"

namespace v3d {
namespace {

TEST(Length, reads_a_number_with_a_unit) {
  EXPECT_DOUBLE_EQ(parse_length("8mm"), 0.008);
  EXPECT_DOUBLE_EQ(parse_length("0.5cm"), 0.005);
  EXPECT_DOUBLE_EQ(parse_length("2m"), 2);
}

TEST(Length, rejects_a_missing_unit_and_invalid_text) {
  for (const char* text :
       {"8", "", "mm", "-1mm", "0mm", "8 mm", "8mmm", "nanm", "infm", "1e999m"}) {
    EXPECT_THROW(parse_length(text), InputError) << text;
  }
}

TEST(Numbers, are_formatted_with_units_and_separators) {
  EXPECT_EQ(format_length(0.008), "8 mm");
  EXPECT_EQ(format_length(1.5), "1.5 m");
  EXPECT_EQ(format_bytes(29.5e9), "29.5 GB");
  EXPECT_EQ(format_bytes(12), "12 B");
  EXPECT_EQ(format_count(1250), "1,250");
  EXPECT_EQ(format_count(999), "999");
  EXPECT_EQ(format_count(-1234567), "-1,234,567");
}

TEST(Numbers, have_the_next_unit_where_rounding_gives_a_thousand) {
  EXPECT_EQ(format_bytes(999.4e9), "999 GB");
  EXPECT_EQ(format_bytes(999.7e9), "1 TB");
  EXPECT_EQ(format_bytes(999.7), "1 kB");
  EXPECT_EQ(format_length(0.9994), "999 mm");
  EXPECT_EQ(format_length(0.9997), "1 m");
}

TEST(Numbers, have_all_digits_before_the_point_in_the_largest_unit) {
  EXPECT_EQ(format_bytes(12'345e15), "12345 PB");
  EXPECT_EQ(format_length(1234), "1234 m");
}

}  // namespace
}  // namespace v3d
