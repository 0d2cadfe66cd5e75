// Periodic sync of mesh files.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cerrno>
#include <thread>
#include <vector>

#include "base/core/time.h"
#include "support/child_process.h"
#include "support/fsync_hook.h"
#include "support/temporary_folder.h"
#include "take/logs/mesh_file.h"

namespace v3d::take {
namespace {

using testing::HasSubstr;

const std::vector<uint8_t> kMesh(1000, 7);

class MeshSync : public testing::Test {
 protected:
  const test::TemporaryFolder folder_;
  MeshFileWriter file_{folder_ / "mesh.v3d"};
  test::FsyncHook hook_;
};

TEST_F(MeshSync, runs_periodically_during_appends_in_another_thread) {
  EXPECT_TRUE(file_.append(0, kMesh));
  ASSERT_TRUE(hook_.wait_for(1));
  EXPECT_NE(hook_.thread(), std::this_thread::get_id());
  EXPECT_TRUE(file_.append(1, kMesh));
  EXPECT_TRUE(hook_.wait_for(2)) << "again in the next second";
}

TEST_F(MeshSync, does_not_block_append) {
  hook_.hold(true);
  EXPECT_TRUE(file_.append(0, kMesh));
  EXPECT_TRUE(hook_.wait_for(1)) << "the sync is blocked";
  EXPECT_TRUE(file_.append(1, kMesh));
  EXPECT_FALSE(hook_.is_stuck()) << "append() waited for the sync";
  hook_.hold(false);
  EXPECT_TRUE(file_.close());
}

TEST_F(MeshSync, reports_an_error_once_by_append_and_by_close) {
  hook_.fail_next(EIO);
  EXPECT_TRUE(file_.append(0, kMesh));
  int64_t pulse = 0;
  const auto is_reported = [&] { return !file_.append(++pulse, kMesh); };
  ASSERT_TRUE(test::becomes_true(is_reported, test::within(10)));
  EXPECT_TRUE(file_.append(++pulse, kMesh));
  const io::Status closed = file_.close();
  ASSERT_FALSE(closed);
  EXPECT_THAT(closed.error().message, HasSubstr("cannot sync"));
  EXPECT_EQ(MeshFileReader(folder_ / "mesh.v3d").pulses().back(), pulse);
}

}  // namespace
}  // namespace v3d::take
