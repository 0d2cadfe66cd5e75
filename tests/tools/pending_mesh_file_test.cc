#include "v3dctl/reconstruct/pending_mesh_file.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/wait.h>
#include <unistd.h>

#include "base/core/error.h"
#include "base/io/file.h"
#include "common/console.h"
#include "support/file_size_limit.h"
#include "support/temporary_folder.h"
#include "take/take_files.h"

namespace v3d::ctl {
namespace {

using testing::ElementsAre;

/// The number of a process that has ended.
pid_t ended_process() {
  const pid_t child = fork();
  if (child == 0) _exit(0);
  waitpid(child, nullptr, 0);
  return child;
}

class PendingMeshFiles : public testing::Test {
 protected:
  /// The file of another process.
  std::filesystem::path make_partial(const std::string& host, pid_t process) const {
    const auto path = folder_ / (".mesh.v3d.partial-" + host + "-" + std::to_string(process));
    replace_file(path, "partial");
    return path;
  }

  const test::TemporaryFolder folder_;
  const take::TakePaths take_{folder_.path()};
};

TEST_F(PendingMeshFiles, are_no_file_of_the_take_until_they_are_finished) {
  PendingMeshFile file(take_.mesh());
  file.append(0, {1, 2, 3});
  EXPECT_THAT(take_file_names(take_).value(), ElementsAre());
  file.finish();
  EXPECT_THAT(take_file_names(take_).value(), ElementsAre("mesh.v3d"));
}

TEST_F(PendingMeshFiles, of_processes_that_were_killed_are_removed) {
  const auto killed = make_partial(host_name(), ended_process());
  const auto running = make_partial(host_name(), getppid());
  const auto elsewhere = make_partial("other-" + host_name(), ended_process());
  PendingMeshFile file(take_.mesh());
  EXPECT_FALSE(file_exists(killed));
  EXPECT_TRUE(file_exists(running));
  EXPECT_TRUE(file_exists(elsewhere)) << "this host knows no processes of another one";
}

TEST_F(PendingMeshFiles, that_a_full_disk_rejects_are_no_bad_input_and_leave_no_file) {
  const test::FileSizeLimit limit(8);
  try {
    const PendingMeshFile file(take_.mesh());
    FAIL() << "the header was written";
  } catch (const InputError& error) {
    FAIL() << "the user can correct this: " << error.what();
  } catch (const std::runtime_error& error) {
    EXPECT_THAT(error.what(), testing::HasSubstr("cannot write " + folder_.path().string()));
  }
  EXPECT_TRUE(std::filesystem::is_empty(folder_.path()));
}

}  // namespace
}  // namespace v3d::ctl
