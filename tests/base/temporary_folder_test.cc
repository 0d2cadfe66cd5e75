// What the tests themselves leave behind.
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
    std::array<char, 1000> said{};
    const ssize_t got = read(pipe_ends[0], said.data(), said.size());
    close(pipe_ends[0]);
    folder_ = std::string(said.data(), static_cast<size_t>(std::max<ssize_t>(got, 0)));
  }
  ~Holder() { kill_it(); }
  Holder(const Holder&) = delete;
  Holder& operator=(const Holder&) = delete;

  const fs::path& folder() const { return folder_; }
  /// No destructor runs.
  void kill_it() {
    if (pid_ <= 0) return;
    kill(pid_, SIGKILL);
    waitpid(pid_, nullptr, 0);
    pid_ = -1;
  }

 private:
  [[noreturn]] static void hold(const fs::path& where, int tell) {
    const TemporaryFolder folder(where);
    write_text(folder / "file", "left");
    const std::string path = folder.path();
    if (write(tell, path.data(), path.size()) < 0) _exit(1);
    for (;;) pause();
  }

  pid_t pid_ = -1;
  fs::path folder_;
};

TEST(TemporaryFolder, is_gone_with_all_in_it) {
  fs::path path;
  {
    const TemporaryFolder folder;
    path = folder.path();
    write_text(folder / "file", "text");
    EXPECT_TRUE(fs::exists(folder / "file"));
  }
  EXPECT_FALSE(fs::exists(path));
}

TEST(TemporaryFolder, of_a_process_that_was_killed_is_taken_away_and_no_other) {
  const TemporaryFolder where;
  Holder killed(where.path()), lives(where.path());
  const TemporaryFolder own(where.path());
  ASSERT_TRUE(fs::exists(killed.folder() / "file"));
  ASSERT_TRUE(fs::exists(lives.folder() / "file"));
  killed.kill_it();
  for (const char* strange : {"v3d-test-aBcDeF", "v3d-test--1-aBcDeF", "v3d-test-7", "v3d-12-x"}) {
    fs::create_directory(where / strange);
  }
  remove_leftovers(where.path());
  EXPECT_FALSE(fs::exists(killed.folder()));
  EXPECT_TRUE(fs::exists(lives.folder() / "file"));
  EXPECT_TRUE(fs::exists(own.path()));
  for (const char* strange : {"v3d-test-aBcDeF", "v3d-test--1-aBcDeF", "v3d-test-7", "v3d-12-x"}) {
    EXPECT_TRUE(fs::exists(where / strange)) << strange;
  }
}

}  // namespace
}  // namespace v3d::test
