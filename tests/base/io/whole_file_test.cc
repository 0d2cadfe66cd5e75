#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/core/error.h"
#include "base/io/file.h"
#include "support/message_of.h"
#include "support/temporary_folder.h"

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

TEST(File, replace_rejects_logs_in_every_folder) {
  const test::TemporaryFolder folder;
  for (const char* name : {"cam01.lcmlog", "cam01.0001.lcmlog", "cam01.lcmlog.index"}) {
    const std::filesystem::path log = folder / name;
    EXPECT_EQ(test::message_of<InputError>([&] { replace_file(log, "report"); }),
              log.string() + ": is a recorded file of a take; expected another file name");
    EXPECT_FALSE(std::filesystem::exists(log));
  }
}

TEST(File, replace_rejects_the_files_of_a_take_and_accepts_others_beside_them) {
  const test::TemporaryFolder folder;
  std::filesystem::create_directories(folder / "background");
  for (const char* name : {"mesh.v3d", "signature.cap01.toml", "background/cam01.mean.png"}) {
    test::write_text(folder / name, "kept");
    EXPECT_NO_THROW(replace_file(folder / name, "written")) << name << " of no take";
    test::write_text(folder / "take.toml", "");
    EXPECT_THROW(replace_file(folder / name, "replaced"), InputError) << name;
    EXPECT_EQ(read_file(folder / name), "written");
    std::filesystem::remove(folder / "take.toml");
  }
  test::write_text(folder / "take.toml", "");
  replace_file(folder / "turntable.png", "one");
  EXPECT_NO_THROW(replace_file(folder / "turntable.png", "two"));
  EXPECT_NO_THROW(replace_file(folder / "calib.toml", "the first one of a new take"));
  EXPECT_THROW(replace_file(folder / "calib.toml", "the second one"), InputError);
}

TEST(File, replace_rejects_a_file_of_a_take_also_through_a_link_and_a_relative_path) {
  const test::TemporaryFolder folder;
  std::filesystem::create_directories(folder / "take/background");
  test::write_text(folder / "take/take.toml", "");
  test::write_text(folder / "take/background/cam01.toml", "kept");
  std::filesystem::create_directory_symlink(folder / "take/background", folder / "plates");
  EXPECT_THROW(replace_file(folder / "plates/cam01.toml", "replaced"), InputError);
  const std::filesystem::path before = std::filesystem::current_path();
  std::filesystem::current_path(folder / "take");
  EXPECT_THROW(replace_file("take.toml", "replaced"), InputError);
  std::filesystem::current_path(before);
  EXPECT_EQ(read_file(folder / "take/background/cam01.toml"), "kept");
}

}  // namespace
}  // namespace v3d
