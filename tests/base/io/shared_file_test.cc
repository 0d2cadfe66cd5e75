#include "base/io/shared_file.h"

#include <gtest/gtest.h>
#include <sys/stat.h>

#include <optional>

#include "base/core/error.h"
#include "support/temporary_folder.h"

namespace v3d {
namespace {

namespace fs = std::filesystem;

TEST(LockFolder, waits_until_another_call_has_released_the_lock) {
  const test::TemporaryFolder folder;
  std::optional<io::UniqueFd> first = io::lock_folder(folder.path()).value();
  int waits = 0;
  const auto second = io::lock_folder(folder.path(), [&] {
    ++waits;
    first.reset();
  });
  EXPECT_TRUE(second);
  EXPECT_EQ(waits, 1);
}

TEST(LockFolder, reports_a_missing_folder) {
  const auto lock = io::lock_folder("/nonexistent");
  ASSERT_FALSE(lock);
  EXPECT_EQ(lock.error().message, "cannot lock /nonexistent: No such file or directory");
}

TEST(UpdateFile, replaces_the_file_that_a_symbolic_link_names) {
  const test::TemporaryFolder folder;
  fs::create_directory(folder / "real");
  test::write_text(folder / "real/studio.toml", "old");
  fs::create_symlink("real/studio.toml", folder / "studio.toml");
  update_file(folder / "studio.toml", "new");
  EXPECT_TRUE(fs::is_symlink(folder / "studio.toml"));
  EXPECT_EQ(read_file(folder / "real/studio.toml"), "new");
  EXPECT_EQ(std::distance(fs::directory_iterator(folder / "real"), {}), 1);
}

TEST(UpdateFile, keeps_the_mode_of_the_file_and_creates_a_missing_one) {
  const test::TemporaryFolder folder;
  const fs::path file = folder / "members.toml";
  update_file(file, "one");
  EXPECT_EQ(read_file(file), "one");
  constexpr auto kMode = fs::perms(0660);
  fs::permissions(file, kMode);
  update_file(file, "two");
  EXPECT_EQ(read_file(file), "two");
  EXPECT_EQ(fs::status(file).permissions(), kMode);
}

TEST(UpdateFile, keeps_the_owner_and_group_of_the_file) {
  if (geteuid() != 0) GTEST_SKIP() << "only root can make a file of another user";
  const test::TemporaryFolder folder;
  const fs::path file = folder / "studio.toml";
  test::write_text(file, "old");
  ASSERT_EQ(chown(file.c_str(), 65534, 65533), 0);
  update_file(file, "new");
  struct stat status {};
  ASSERT_EQ(stat(file.c_str(), &status), 0);
  EXPECT_EQ(status.st_uid, 65534);
  EXPECT_EQ(status.st_gid, 65533);
}

TEST(UpdateFile, rejects_a_recorded_file_behind_a_symbolic_link) {
  const test::TemporaryFolder folder;
  test::write_text(folder / "cam01.lcmlog", "kept");
  fs::create_symlink("cam01.lcmlog", folder / "studio.toml");
  EXPECT_THROW(update_file(folder / "studio.toml", "new"), InputError);
  EXPECT_EQ(read_file(folder / "cam01.lcmlog"), "kept");
}

}  // namespace
}  // namespace v3d
