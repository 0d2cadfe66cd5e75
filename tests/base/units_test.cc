#include "base/units.h"

#include <gtest/gtest.h>

#include "base/error.h"
#include "base/name.h"

namespace v3d {
namespace {

TEST(Length, is_read_with_its_unit) {
  EXPECT_DOUBLE_EQ(parse_length("8mm"), 0.008);
  EXPECT_DOUBLE_EQ(parse_length("0.5cm"), 0.005);
  EXPECT_DOUBLE_EQ(parse_length("2m"), 2);
}

TEST(Length, without_a_unit_or_with_nonsense_is_refused) {
  for (const char* text :
       {"8", "", "mm", "-1mm", "0mm", "8 mm", "8mmm", "nanm", "infm", "1e999m"}) {
    EXPECT_THROW(parse_length(text), InputError) << text;
  }
}

TEST(Bounds, are_two_corners_the_first_below_the_second) {
  const Box box = parse_bounds("-0.6,-0.6,-0.1,0.6,0.6,1.9");
  EXPECT_EQ(box.min, Eigen::Vector3d(-0.6, -0.6, -0.1));
  EXPECT_EQ(box.max, Eigen::Vector3d(0.6, 0.6, 1.9));
  for (const char* text :
       {"", "1,2,3", "0,0,0,1,1,0", "0,0,0,1,1,1,", "0,0,0,1,1,x", "0 0 0 1 1 1"}) {
    EXPECT_THROW(parse_bounds(text), InputError) << text;
  }
}

TEST(Numbers, are_written_for_people) {
  EXPECT_EQ(format_length(0.008), "8 mm");
  EXPECT_EQ(format_length(1.5), "1.5 m");
  EXPECT_EQ(format_bytes(29.5e9), "29.5 GB");
  EXPECT_EQ(format_bytes(12), "12 B");
  EXPECT_EQ(format_count(1250), "1,250");
  EXPECT_EQ(format_count(999), "999");
  EXPECT_EQ(format_count(-1234567), "-1,234,567");
}

TEST(FileName, is_harmless_as_part_of_a_path) {
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
