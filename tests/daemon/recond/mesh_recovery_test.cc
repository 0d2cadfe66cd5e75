#include "daemon/recond/mesh_recovery.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cerrno>

#include "base/io/file.h"
#include "support/fsync_hook.h"
#include "support/notify_socket.h"
#include "support/temporary_folder.h"
#include "take/logs/mesh_file.h"

namespace v3d::recond {
namespace {

using testing::HasSubstr;

/// A mesh file whose writer was killed before it wrote the index.
class MeshRecovery : public testing::Test {
 protected:
  MeshRecovery() {
    {
      take::MeshFileWriter file(path_);
      for (int64_t pulse = 0; pulse < 5; ++pulse) {
        EXPECT_TRUE(file.append(pulse, std::vector<uint8_t>(100, 7)));
      }
    }
    std::filesystem::resize_file(path_, 16 + 5 * 124);
  }

  const test::TemporaryFolder folder_;
  const std::filesystem::path path_ = folder_ / "mesh.v3d";
};

TEST_F(MeshRecovery, adds_the_missing_index) {
  const RecoveredMeshes recovered = recover_mesh_file(path_);
  EXPECT_TRUE(recovered.is_whole);
  EXPECT_EQ(recovered.meshes, 5);
  EXPECT_EQ(recovered.text, "5 meshes recovered");
  EXPECT_FALSE(take::MeshFileReader(path_).index_was_rebuilt());
}

TEST_F(MeshRecovery, extends_the_time_for_the_start) {
  test::NotifySocket systemd(folder_ / "notify");
  EXPECT_TRUE(recover_mesh_file(path_).is_whole);
  EXPECT_THAT(systemd.received(), HasSubstr("STATUS=recovering the meshes of "));
  EXPECT_THAT(systemd.received(), HasSubstr("EXTEND_TIMEOUT_USEC="));
}

TEST_F(MeshRecovery, reports_an_index_that_cannot_be_synced_with_path_and_cause) {
  test::FsyncHook hook;
  hook.fail_next(EIO);
  const RecoveredMeshes recovered = recover_mesh_file(path_);
  EXPECT_FALSE(recovered.is_whole);
  EXPECT_EQ(recovered.meshes, 5);
  EXPECT_EQ(recovered.text, "5 meshes recovered; no index was added: cannot sync " +
                                path_.string() + ": Input/output error");
}

TEST_F(MeshRecovery, reports_no_number_of_meshes_of_a_file_that_cannot_be_read) {
  test::write_text(path_, "");
  const RecoveredMeshes recovered = recover_mesh_file(path_);
  EXPECT_FALSE(recovered.is_whole);
  EXPECT_EQ(recovered.meshes, std::nullopt);
  EXPECT_THAT(recovered.text,
              HasSubstr("no meshes recovered: " + path_.string() + ": is not a mesh file"));
}

}  // namespace
}  // namespace v3d::recond
