#include <gtest/gtest.h>

#include <string>
#include <vector>

#include "base/core/text.h"

namespace v3d {
namespace {

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

TEST(NameList, ends_after_24_names) {
  EXPECT_EQ(join_names({}), "");
  EXPECT_EQ(join_names({"cam00", "cam01"}), "cam00, cam01");
  const std::vector<std::string> names(24, "a");
  EXPECT_FALSE(join_names(names).ends_with("..."));
  EXPECT_TRUE(join_names(std::vector<std::string>(25, "a")).ends_with("a, ..."));
  EXPECT_EQ(join_names(std::vector<std::string>(25, "a")), join_names(names) + ", ...");
}

}  // namespace
}  // namespace v3d
