#include "base/io/whole_file.h"

#include <gtest/gtest.h>

#include "base/core/error.h"

namespace v3d {
namespace {

TEST(File, replace_writes_the_content_and_leaves_no_temporary_file) {
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

TEST(File, read_reports_path_and_cause_of_a_failure) {
  try {
    read_file("/nonexistent/studio.toml");
    FAIL() << "read_file() returned for a missing file";
  } catch (const InputError& error) {
    EXPECT_EQ(std::string(error.what()),
              "cannot read /nonexistent/studio.toml: No such file or directory");
  }
  try {
    read_file("/proc");
    FAIL() << "read_file() returned for a folder";
  } catch (const InputError& error) {
    EXPECT_EQ(std::string(error.what()), "cannot read /proc: it is not a regular file");
  }
  EXPECT_THROW(replace_file("/nonexistent/x", ""), std::runtime_error);
}

}  // namespace
}  // namespace v3d
