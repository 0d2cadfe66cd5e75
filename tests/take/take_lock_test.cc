#include "take/take_lock.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cerrno>

#include "support/lock_holder.h"
#include "support/temporary_folder.h"

namespace v3d {
namespace {

namespace fs = std::filesystem;
using testing::HasSubstr;

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
  EXPECT_THAT(take_lock_holder(paths_),
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
  EXPECT_EQ(take_lock_holder(paths_), "");
  EXPECT_TRUE(TakeLock::acquire(paths_, "cap01"));
}

TEST_F(TakeLocks, require_the_take_folder) {
  EXPECT_EQ(TakeLock::acquire({folder_ / "gone"}, "cap01").error().code, ENOENT);
}

}  // namespace
}  // namespace v3d
