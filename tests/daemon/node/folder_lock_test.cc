#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/file.h>
#include <sys/syscall.h>
#include <unistd.h>

#include <cerrno>
#include <optional>

#include "base/core/error.h"
#include "daemon/node/take_folder.h"
#include "support/message_of.h"
#include "support/temporary_folder.h"

namespace v3d::node {
namespace {

int flock_error = 0;  ///< injected into flock(); 0: none

TEST(FolderLock, names_the_daemon_that_holds_it) {
  const test::TemporaryFolder folder;
  std::optional<FolderLock> first(std::in_place, folder.path(), ".lock", "recon01");
  EXPECT_THAT(test::message_of<InputError>([&] { FolderLock(folder.path(), ".lock", "recon02"); }),
              testing::HasSubstr("recon01 writes its takes here already"));
  first.reset();
  const FolderLock second(folder.path(), ".lock", "recon02");
}

TEST(FolderLock, reports_an_error_of_the_file_system_as_that_error) {
  const test::TemporaryFolder folder;
  flock_error = EIO;
  EXPECT_THAT(test::message_of<InputError>([&] { FolderLock(folder.path(), ".lock", "recon01"); }),
              testing::AllOf(testing::HasSubstr((folder / ".lock").string()),
                             testing::HasSubstr("Input/output error")));
  flock_error = 0;
}

}  // namespace
}  // namespace v3d::node

/// Replaces that of the C library, to inject errors.
extern "C" int flock(int fd, int operation) {
  if (v3d::node::flock_error == 0) return static_cast<int>(syscall(SYS_flock, fd, operation));
  errno = v3d::node::flock_error;
  return -1;
}
