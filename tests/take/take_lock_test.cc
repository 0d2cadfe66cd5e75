#include "take/take_lock.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/syscall.h>
#include <unistd.h>

#include <cerrno>

#include "support/lock_holder.h"
#include "support/studio_text.h"
#include "support/temporary_folder.h"

namespace v3d::take {
namespace {

namespace fs = std::filesystem;
using testing::AllOf;
using testing::HasSubstr;

int flock_error = 0;  ///< injected into flock(); 0: none

class TakeLocks : public testing::Test {
 protected:
  const test::TemporaryFolder folder_;
  const TakePaths paths_{folder_.path()};
};

TEST_F(TakeLocks, exclude_a_second_process_of_the_same_node_until_the_first_ends) {
  test::LockHolder first(paths_, "cap01");
  const auto second = TakeLock::acquire(paths_, "cap01");
  ASSERT_FALSE(second);
  EXPECT_EQ(second.error().code, EWOULDBLOCK);
  EXPECT_THAT(second.error().message, HasSubstr("process " + std::to_string(first.pid()) + " on "));
  EXPECT_THAT(take_lock_holder(paths_).value(),
              HasSubstr("process " + std::to_string(first.pid()) + " on "));
  first.kill();
  const auto after = TakeLock::acquire(paths_, "cap01");
  ASSERT_TRUE(after) << after.error().message;
  EXPECT_TRUE(after->excludes());
}

TEST_F(TakeLocks, of_other_nodes_do_not_exclude_each_other) {
  const test::LockHolder other(paths_, "cap02");
  EXPECT_TRUE(TakeLock::acquire(paths_, "cap01"));
}

TEST_F(TakeLocks, leave_no_file_and_ignore_the_file_of_an_ended_process) {
  { const auto lock = TakeLock::acquire(paths_, "cap01"); }
  EXPECT_TRUE(fs::is_empty(folder_.path()));
  test::write_text(paths_.folder / ".cap01.lock", "process 1 on cap01\n");
  EXPECT_EQ(take_lock_holder(paths_).value(), "");
  EXPECT_TRUE(TakeLock::acquire(paths_, "cap01"));
}

TEST_F(TakeLocks, require_the_take_folder) {
  EXPECT_EQ(TakeLock::acquire({folder_ / "gone"}, "cap01").error().code, ENOENT);
}

/// A lock file that cannot be opened may be held: here it is a link, which is not followed.
TEST_F(TakeLocks, report_a_lock_file_that_cannot_be_opened_and_a_folder_that_cannot_be_listed) {
  fs::create_symlink("elsewhere", paths_.folder / ".cap01.lock");
  EXPECT_THAT(take_lock_holder(paths_).error().message,
              AllOf(HasSubstr((paths_.folder / ".cap01.lock").string()),
                    HasSubstr("Too many levels of symbolic links")));
  EXPECT_EQ(lock_whole_take(paths_).error().code, ELOOP);
  EXPECT_EQ(take_lock_holder({folder_ / "gone"}).error().code, ENOENT);
  EXPECT_EQ(lock_whole_take({folder_ / "gone"}).error().code, ENOENT);
}

TEST_F(TakeLocks, report_an_error_of_the_file_system_as_that_error) {
  test::write_text(paths_.folder / ".cap01.lock", "");
  flock_error = EIO;
  EXPECT_EQ(take_lock_holder(paths_).error().code, EIO);
  EXPECT_EQ(TakeLock::acquire(paths_, "cap01").error().code, EIO);
  flock_error = ENOLCK;
  EXPECT_EQ(take_lock_holder(paths_).value(), "") << "the file system has no locks";
  flock_error = 0;
}

TEST_F(TakeLocks, of_a_whole_take_exclude_every_node_of_its_studio_file) {
  test::write_text(paths_.studio(), test::studio_text({{"cap01", {"cam01"}}, {"cap02", {}}}));
  const auto locks = lock_whole_take(paths_);
  ASSERT_TRUE(locks) << locks.error().message;
  for (const char* node : {"cap01", "cap02"}) {
    EXPECT_EQ(TakeLock::acquire(paths_, node).error().code, EWOULDBLOCK) << node;
  }
}

TEST_F(TakeLocks, of_a_whole_take_are_not_granted_while_a_process_of_any_node_has_one) {
  for (const char* node : {"cap02", "no-longer-in-the-studio"}) {
    const test::LockHolder holder(paths_, node);
    const auto locks = lock_whole_take(paths_);
    ASSERT_FALSE(locks);
    EXPECT_EQ(locks.error().code, EWOULDBLOCK);
    EXPECT_TRUE(TakeLock::acquire(paths_, "cap01")) << "no lock is left";
  }
}

TEST_F(TakeLocks, do_not_remove_the_lock_file_of_a_new_take_with_the_same_name) {
  const TakePaths take{folder_ / "take"};
  fs::create_directories(take.folder);
  {
    const auto locks = TakeLock::acquire(take, "cap01");
    fs::rename(take.folder, folder_ / "deleted");
    fs::create_directories(take.folder);
    test::write_text(take.folder / ".cap01.lock", "");
  }
  EXPECT_TRUE(fs::exists(take.folder / ".cap01.lock"));
}

}  // namespace
}  // namespace v3d::take

/// Replaces that of the C library, to inject errors.
extern "C" int flock(int fd, int operation) {
  if (v3d::take::flock_error == 0) return static_cast<int>(syscall(SYS_flock, fd, operation));
  errno = v3d::take::flock_error;
  return -1;
}
