// Tests that temporary folders of tests are removed.
#include "support/temporary_folder.h"

#include <gtest/gtest.h>
#include <sys/wait.h>

#include <array>

namespace v3d::test {
namespace {

namespace fs = std::filesystem;

/// A process that holds a temporary folder with a file in it until it is killed.
class Holder {
 public:
  explicit Holder(const fs::path& where) {
    std::array<int, 2> pipe_ends{-1, -1};
    if (pipe(pipe_ends.data()) != 0) throw std::runtime_error("pipe");
    pid_ = fork();
    if (pid_ == 0) hold(where, pipe_ends[1]);
    close(pipe_ends[1]);
    std::array<char, 1000> path_text{};
    const ssize_t got = read(pipe_ends[0], path_text.data(), path_text.size());
    close(pipe_ends[0]);
    folder_ = std::string(path_text.data(), static_cast<size_t>(std::max<ssize_t>(got, 0)));
  }
  ~Holder() { kill_process(); }
  Holder(const Holder&) = delete;
  Holder& operator=(const Holder&) = delete;

  const fs::path& folder() const { return folder_; }
  /// Ends the process without running destructors.
  void kill_process() {
    if (pid_ <= 0) return;
    kill(pid_, SIGKILL);
    waitpid(pid_, nullptr, 0);
    pid_ = -1;
  }

 private:
  [[noreturn]] static void hold(const fs::path& where, int pipe_fd) {
    const TemporaryFolder folder(where);
    write_text(folder / "file", "left");
    const std::string path = folder.path();
    if (write(pipe_fd, path.data(), path.size()) < 0) _exit(1);
    for (;;) pause();
  }

  pid_t pid_ = -1;
  fs::path folder_;
};

TEST(TemporaryFolder, is_removed_with_its_content) {
  fs::path path;
  {
    const TemporaryFolder folder;
    path = folder.path();
    write_text(folder / "file", "text");
    EXPECT_TRUE(fs::exists(folder / "file"));
  }
  EXPECT_FALSE(fs::exists(path));
}

TEST(TemporaryFolder, remove_leftovers_removes_only_folders_of_killed_processes) {
  const TemporaryFolder where;
  Holder killed(where.path()), running(where.path());
  const TemporaryFolder own(where.path());
  ASSERT_TRUE(fs::exists(killed.folder() / "file"));
  ASSERT_TRUE(fs::exists(running.folder() / "file"));
  killed.kill_process();
  for (const char* other : {"v3d-test-aBcDeF", "v3d-test--1-aBcDeF", "v3d-test-7", "v3d-12-x"}) {
    fs::create_directory(where / other);
  }
  remove_leftovers(where.path());
  EXPECT_FALSE(fs::exists(killed.folder()));
  EXPECT_TRUE(fs::exists(running.folder() / "file"));
  EXPECT_TRUE(fs::exists(own.path()));
  for (const char* other : {"v3d-test-aBcDeF", "v3d-test--1-aBcDeF", "v3d-test-7", "v3d-12-x"}) {
    EXPECT_TRUE(fs::exists(where / other)) << other;
  }
}

}  // namespace
}  // namespace v3d::test
