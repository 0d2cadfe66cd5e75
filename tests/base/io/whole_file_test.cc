#include "base/io/whole_file.h"

#include <gtest/gtest.h>

#include "base/core/error.h"

namespace v3d {
namespace {

TEST(File, that_was_replaced_reads_back_and_leaves_no_temporary_behind) {
  const std::filesystem::path folder = testing::TempDir() + "/v3d_file_test";
  std::filesystem::create_directories(folder);
  replace_file(folder / "a", "one");
  replace_file(folder / "a", std::string("t\0wo", 4));
  EXPECT_EQ(read_file(folder / "a"), std::string("t\0wo", 4));
  replace_file(folder / "a", "");
  EXPECT_EQ(read_file(folder / "a"), "");
  EXPECT_EQ(std::distance(std::filesystem::directory_iterator(folder), {}), 1);
  std::filesystem::remove_all(folder);
}

TEST(File, that_cannot_be_read_is_named_with_the_cause) {
  try {
    read_file("/nonexistent/studio.toml");
    FAIL() << "read a file that does not exist";
  } catch (const InputError& error) {
    EXPECT_EQ(std::string(error.what()),
              "cannot read /nonexistent/studio.toml: No such file or directory");
  }
  try {
    read_file("/proc");
    FAIL() << "read a folder";
  } catch (const InputError& error) {
    EXPECT_EQ(std::string(error.what()), "cannot read /proc: it is not a regular file");
  }
  EXPECT_THROW(replace_file("/nonexistent/x", ""), std::runtime_error);
}

}  // namespace
}  // namespace v3d
