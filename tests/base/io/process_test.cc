#include "base/io/process.h"

#include <fcntl.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <atomic>
#include <cerrno>
#include <csignal>
#include <cstdlib>
#include <future>
#include <sstream>
#include <thread>
#include <utility>

#include "base/io/file.h"
#include "support/child_process.h"
#include "support/temporary_folder.h"

namespace v3d {
namespace {

/// Runs programs and reads their output from a file.
class Process : public testing::Test {
 protected:
  std::string output_of(const std::vector<std::string>& words, SpawnOptions options = {}) {
    const auto path = folder_ / "output";
    options.output = ::open(path.c_str(), O_WRONLY | O_CREAT | O_TRUNC | O_CLOEXEC, 0644);
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

TEST_F(Process, returns_its_exit_status_or_128_plus_the_signal) {
  EXPECT_EQ(status_of("exit 0"), 0);
  EXPECT_EQ(status_of("exit 3"), 3);
  EXPECT_EQ(status_of("kill -KILL $$"), 128 + SIGKILL);
}

TEST_F(Process, receives_its_arguments_unchanged_without_a_shell) {
  EXPECT_EQ(output_of({"/bin/echo", "two words", "$HOME", "*"}), "two words $HOME *\n");
}

TEST_F(Process, is_searched_on_the_path_only_on_request) {
  EXPECT_EQ(output_of({"echo", "found"}, {.on_path = true}), "found\n");
  EXPECT_EQ(spawn_process({"echo", "found"}, {}), -1);
}

TEST_F(Process, sets_errno_for_a_missing_program) {
  errno = 0;
  EXPECT_EQ(spawn_process({"/not/there"}, {}), -1);
  EXPECT_EQ(errno, ENOENT);
  EXPECT_EQ(spawn_process({"v3d-none"}, {.on_path = true}), -1);
  EXPECT_EQ(errno, ENOENT);
}

TEST_F(Process, inherits_only_the_given_descriptors) {
  const int inherited = ::open("/dev/zero", O_RDONLY);  // not close-on-exec
  std::istringstream listed(output_of({"/bin/ls", "/proc/self/fd"}));
  std::vector<int> open_files;
  for (int fd = 0; listed >> fd;) open_files.push_back(fd);
  close(inherited);
  EXPECT_EQ(open_files, (std::vector<int>{0, 1, 2, 3})) << "3 is the listed folder";
}

TEST_F(Process, uses_dev_null_without_descriptors) {
  EXPECT_EQ(output_of({"/bin/readlink", "/proc/self/fd/0", "/proc/self/fd/2"}),
            "/dev/null\n/dev/null\n");
}

TEST_F(Process, reads_the_given_input) {
  test::write_text(folder_ / "input", "five words on one line");
  const int input = ::open((folder_ / "input").c_str(), O_RDONLY | O_CLOEXEC);
  EXPECT_EQ(output_of({"/bin/cat"}, {.input = input}), "five words on one line");
  close(input);
}

TEST_F(Process, uses_the_given_environment_or_inherits_one) {
  setenv("V3D_OF_THE_TEST", "1", 1);
  EXPECT_EQ(output_of({"/usr/bin/env"}, {.environment = {{"A=1", "B=two words"}}}),
            "A=1\nB=two words\n");
  EXPECT_NE(output_of({"/usr/bin/env"}).find("V3D_OF_THE_TEST=1\n"), std::string::npos);
  unsetenv("V3D_OF_THE_TEST");
}

/// Blocks SIGTERM, and ignores SIGHUP and SIGPIPE, during each test.
class ProcessWithBlockedSignals : public Process {
 protected:
  ProcessWithBlockedSignals() {
    sigset_t blocked;
    sigemptyset(&blocked);
    sigaddset(&blocked, SIGTERM);
    pthread_sigmask(SIG_BLOCK, &blocked, &before_);
    std::signal(SIGHUP, SIG_IGN);
    std::signal(SIGPIPE, SIG_IGN);
  }
  ~ProcessWithBlockedSignals() override {
    pthread_sigmask(SIG_SETMASK, &before_, nullptr);
    std::signal(SIGHUP, SIG_DFL);
    std::signal(SIGPIPE, SIG_DFL);
  }
  /// Blocked and ignored signals of the program: signal n is bit n - 1. Excludes signals 32 and 33,
  /// which glibc uses.
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

TEST_F(ProcessWithBlockedSignals, resets_all_signals_on_request) {
  EXPECT_EQ(signals(true), std::pair(uint64_t{0}, uint64_t{0}));
}

TEST_F(ProcessWithBlockedSignals, inherits_signals_by_default) {
  const auto bit = [](int signal) { return uint64_t{1} << (signal - 1); };
  EXPECT_EQ(signals(false), std::pair(bit(SIGTERM), bit(SIGHUP) | bit(SIGPIPE)));
}

TEST_F(Process, poll_does_not_block_and_kill_ends_the_process) {
  const pid_t child = spawn_process({"/bin/sleep", "1000"}, {});
  ASSERT_GT(child, 0);
  EXPECT_FALSE(poll_process(child));
  kill_process(child);
  EXPECT_EQ(kill(child, 0), -1) << "the process was already reaped";
  EXPECT_EQ(poll_process(child), 127)
      << "the status of a reaped process is unknown, which is not a success";
  EXPECT_EQ(wait_for_process(child), 127);
  kill_process(-1);
}

TEST(ThreadSleeps, while_it_waits_and_not_while_it_runs) {
  std::atomic<bool> is_running = true;
  std::atomic<pid_t> id = 0;
  std::promise<void> end;
  std::jthread thread([&] {
    id = gettid();
    while (is_running) {
    }
    end.get_future().wait();
  });
  while (id == 0) std::this_thread::yield();
  for (int i = 0; i < 20; ++i) EXPECT_FALSE(thread_sleeps(id));
  is_running = false;
  EXPECT_TRUE(test::becomes_true([&] { return thread_sleeps(id); }, test::within(30)));
  end.set_value();
  thread.join();
  EXPECT_TRUE(thread_sleeps(id)) << "it has ended";
}

TEST(IsolatedProcessors, are_read_as_the_kernel_writes_them) {
  EXPECT_EQ(parse_processor_list("2-4,7"), (std::vector<int>{2, 3, 4, 7}));
  EXPECT_EQ(parse_processor_list("3"), std::vector<int>{3});
  for (const char* text : {"", "2-", "-2", "3-2", "2,x", "2;3", "1-99999", "nohz"}) {
    EXPECT_TRUE(parse_processor_list(text).empty()) << text;
  }
}

TEST(IsolatedProcessors, give_the_trigger_one_of_its_own) {
  EXPECT_EQ(processors_for(IsolatedTask::kTrigger, {2, 3, 5}), std::vector<int>{5});
  EXPECT_EQ(processors_for(IsolatedTask::kPackets, {2, 3, 5}), (std::vector<int>{2, 3}));
  EXPECT_EQ(processors_for(IsolatedTask::kTrigger, {3}), std::vector<int>{3});
  EXPECT_TRUE(processors_for(IsolatedTask::kPackets, {3}).empty())
      << "packets must not delay the trigger";
  EXPECT_TRUE(processors_for(IsolatedTask::kTrigger, {}).empty());
}

}  // namespace
}  // namespace v3d
