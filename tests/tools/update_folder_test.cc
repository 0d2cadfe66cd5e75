#include <gmock/gmock.h>

#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <optional>
#include <stdexcept>
#include <string>
#include <utility>

#include "base/io/file.h"
#include "support/temporary_folder.h"
#include "v3dctl/setup/update.h"

namespace v3d::ctl {
namespace {

namespace fs = std::filesystem;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::Not;

class UpdateFolderOverARemoteShell : public ::testing::Test {
 protected:
  /// A program with this text of a shell script.
  fs::path program(const std::string& name, const std::string& text) {
    const fs::path path = folder_ / name;
    std::ofstream(path) << "#!/bin/sh\n" << text << "\n";
    fs::permissions(path, fs::perms::owner_all);
    return path;
  }
  test::TemporaryFolder folder_;
};

TEST_F(UpdateFolderOverARemoteShell, gives_up_a_request_and_a_report_of_a_pc_that_lost_its_power) {
  // Reads what rsync sends, and never replies. After a minute, it ends by itself.
  const fs::path waited = folder_ / "waited";
  const fs::path shell =
      program("rsh", "timeout 60 cat >/dev/null\n[ $? != 124 ] || touch " + waited.string());
  const UpdateFolder updates(shell, "/var/lib/v3d/updates", 1);
  EXPECT_THAT(updates.report("cap01"), IsEmpty());
  EXPECT_FALSE(fs::exists(waited)) << "the report is given up after the remote shell only";
  EXPECT_THROW(updates.send_request("cap01", "7"), std::runtime_error);
  EXPECT_FALSE(fs::exists(waited)) << "the request is given up after the remote shell only";
}

/// A variable of the environment, until the end of the scope.
class Variable {
 public:
  Variable(std::string name, const std::string& value) : name_(std::move(name)) {
    if (const char* const before = std::getenv(name_.c_str())) before_ = before;
    setenv(name_.c_str(), value.c_str(), 1);
  }
  ~Variable() { before_ ? setenv(name_.c_str(), before_->c_str(), 1) : unsetenv(name_.c_str()); }
  Variable(const Variable&) = delete;
  Variable& operator=(const Variable&) = delete;

 private:
  std::string name_;
  std::optional<std::string> before_;
};

TEST_F(UpdateFolderOverARemoteShell, is_ssh_that_ends_when_the_pc_does_not_reply) {
  const fs::path words = folder_ / "words";
  program("ssh", "echo \"$@\" >" + words.string() + "\nexit 255");
  unsetenv("RSYNC_RSH");
  const Variable path("PATH", folder_.path().string() + ":" + std::getenv("PATH"));
  EXPECT_THAT(UpdateFolder("").report("cap01"), IsEmpty());
  EXPECT_THAT(io::read_file(words, 10000).value_or(""), HasSubstr("ServerAliveInterval=10"));
  EXPECT_THAT(io::read_file(words, 10000).value_or(""), HasSubstr("ConnectTimeout="));
}

TEST_F(UpdateFolderOverARemoteShell, is_the_one_of_rsyncs_variable) {
  const fs::path words = folder_ / "words";
  const Variable shell("RSYNC_RSH",
                       program("other", "echo \"$@\" >" + words.string() + "\nexit 255"));
  EXPECT_THAT(UpdateFolder("").report("cap01"), IsEmpty());
  EXPECT_THAT(io::read_file(words, 10000).value_or(""), Not(IsEmpty()));
}

}  // namespace
}  // namespace v3d::ctl
