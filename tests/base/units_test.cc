#include "base/units.h"

#include <gtest/gtest.h>

#include "base/error.h"
#include "base/name.h"

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

TEST(Bounds, are_two_corners_in_ascending_order) {
  const Box box = parse_bounds("-0.6,-0.6,-0.1,0.6,0.6,1.9");
  EXPECT_EQ(box.min, Eigen::Vector3d(-0.6, -0.6, -0.1));
  EXPECT_EQ(box.max, Eigen::Vector3d(0.6, 0.6, 1.9));
  for (const char* text :
       {"", "1,2,3", "0,0,0,1,1,0", "0,0,0,1,1,1,", "0,0,0,1,1,x", "0 0 0 1 1 1"}) {
    EXPECT_THROW(parse_bounds(text), InputError) << text;
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

TEST(FileName, rejects_names_that_are_unsafe_in_a_path) {
  for (const char* good : {"cam01", "kendo-07", "GV-4103", "a.b", "_x"}) {
    EXPECT_TRUE(is_file_name(good)) << good;
  }
  for (const char* bad : {"", ".", "..", "-rf", "a/b", "a b", "a\n", "\xc3\xa4"}) {
    EXPECT_FALSE(is_file_name(bad)) << bad;
  }
  EXPECT_TRUE(is_file_name(std::string(64, 'a')));
  EXPECT_FALSE(is_file_name(std::string(65, 'a')));
}

}  // namespace
}  // namespace v3d
