#include "base/io/process.h"

#include <fcntl.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <cerrno>
#include <csignal>
#include <cstdlib>
#include <sstream>
#include <utility>

#include "base/io/whole_file.h"
#include "support/temporary_folder.h"

namespace v3d {
namespace {

/// Runs programs whose output goes to a file.
class Process : public testing::Test {
 protected:
  std::string output_of(const std::vector<std::string>& words, SpawnOptions options = {}) {
    const auto path = folder_ / "output";
    options.output = open(path.c_str(), O_WRONLY | O_CREAT | O_TRUNC | O_CLOEXEC, 0644);
    const pid_t child = spawn_process(words, options);
    close(options.output);
    EXPECT_GT(child, 0);
    EXPECT_EQ(wait_for_process(child), 0);
    return read_file(path);
  }
  static int status_of(const std::string& script) {
    return wait_for_process(spawn_process({"/bin/sh", "-c", script}, {}));
  }

  test::TemporaryFolder folder_;
};

TEST_F(Process, ends_with_its_exit_status_or_128_and_the_signal_that_ended_it) {
  EXPECT_EQ(status_of("exit 0"), 0);
  EXPECT_EQ(status_of("exit 3"), 3);
  EXPECT_EQ(status_of("kill -KILL $$"), 128 + SIGKILL);
}

TEST_F(Process, gets_its_arguments_as_they_are_without_a_shell) {
  EXPECT_EQ(output_of({"/bin/echo", "two words", "$HOME", "*"}), "two words $HOME *\n");
}

TEST_F(Process, is_looked_for_on_the_path_only_when_it_is_asked_for) {
  EXPECT_EQ(output_of({"echo", "found"}, {.on_path = true}), "found\n");
  EXPECT_EQ(spawn_process({"echo", "found"}, {}), -1);
}

TEST_F(Process, that_does_not_exist_is_told_by_errno) {
  errno = 0;
  EXPECT_EQ(spawn_process({"/not/there"}, {}), -1);
  EXPECT_EQ(errno, ENOENT);
  EXPECT_EQ(spawn_process({"v3d-none"}, {.on_path = true}), -1);
  EXPECT_EQ(errno, ENOENT);
}

TEST_F(Process, has_no_descriptor_of_ours_but_those_that_it_is_given) {
  const int inherited = open("/dev/zero", O_RDONLY);  // not close-on-exec
  std::istringstream listed(output_of({"/bin/ls", "/proc/self/fd"}));
  std::vector<int> open_files;
  for (int fd = 0; listed >> fd;) open_files.push_back(fd);
  close(inherited);
  EXPECT_EQ(open_files, (std::vector<int>{0, 1, 2, 3})) << "3 is the folder that it lists";
}

TEST_F(Process, reads_and_says_nothing_where_it_is_given_no_descriptor) {
  EXPECT_EQ(output_of({"/bin/readlink", "/proc/self/fd/0", "/proc/self/fd/2"}),
            "/dev/null\n/dev/null\n");
}

TEST_F(Process, reads_what_it_is_given) {
  test::write_text(folder_ / "input", "five words on one line");
  const int input = open((folder_ / "input").c_str(), O_RDONLY | O_CLOEXEC);
  EXPECT_EQ(output_of({"/bin/cat"}, {.input = input}), "five words on one line");
  close(input);
}

TEST_F(Process, has_the_environment_that_it_is_given_and_else_ours) {
  setenv("V3D_OF_THE_TEST", "1", 1);
  EXPECT_EQ(output_of({"/usr/bin/env"}, {.environment = {{"A=1", "B=two words"}}}),
            "A=1\nB=two words\n");
  EXPECT_NE(output_of({"/usr/bin/env"}).find("V3D_OF_THE_TEST=1\n"), std::string::npos);
  unsetenv("V3D_OF_THE_TEST");
}

/// Blocks SIGTERM and ignores SIGHUP and SIGPIPE meanwhile.
class ProcessOfDeafParent : public Process {
 protected:
  ProcessOfDeafParent() {
    sigset_t blocked;
    sigemptyset(&blocked);
    sigaddset(&blocked, SIGTERM);
    pthread_sigmask(SIG_BLOCK, &blocked, &before_);
    std::signal(SIGHUP, SIG_IGN);
    std::signal(SIGPIPE, SIG_IGN);
  }
  ~ProcessOfDeafParent() override {
    pthread_sigmask(SIG_SETMASK, &before_, nullptr);
    std::signal(SIGHUP, SIG_DFL);
    std::signal(SIGPIPE, SIG_DFL);
  }
  /// Those that the program has blocked and ignored: signal n is bit n - 1. Not 32 and 33, which
  /// are glibc's own.
  std::pair<uint64_t, uint64_t> signals(bool default_signals) {
    std::istringstream status(output_of({"/bin/grep", "-E", "^Sig(Blk|Ign)", "/proc/self/status"},
                                        {.default_signals = default_signals}));
    std::string name;
    uint64_t blocked = 0, ignored = 0;
    status >> std::hex >> name >> blocked >> name >> ignored;
    return {blocked, ignored & 0x7fff'ffff};
  }

 private:
  sigset_t before_;
};

TEST_F(ProcessOfDeafParent, has_every_signal_as_by_default_where_it_is_asked_for) {
  EXPECT_EQ(signals(true), std::pair(uint64_t{0}, uint64_t{0}));
}

TEST_F(ProcessOfDeafParent, inherits_signals_otherwise) {
  const auto bit = [](int signal) { return uint64_t{1} << (signal - 1); };
  EXPECT_EQ(signals(false), std::pair(bit(SIGTERM), bit(SIGHUP) | bit(SIGPIPE)));
}

TEST_F(Process, is_polled_without_waiting_and_killed) {
  const pid_t child = spawn_process({"/bin/sleep", "1000"}, {});
  ASSERT_GT(child, 0);
  EXPECT_FALSE(poll_process(child));
  kill_process(child);
  EXPECT_EQ(kill(child, 0), -1) << "it has been waited for";
  EXPECT_EQ(poll_process(child), 127) << "nothing is known of it any more, so it was no success";
  EXPECT_EQ(wait_for_process(child), 127);
  kill_process(-1);
}

}  // namespace
}  // namespace v3d
