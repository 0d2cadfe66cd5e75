#include "daemon/node/service.h"

#include <gmock/gmock.h>
#include <sys/mman.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <csignal>
#include <cstdlib>
#include <stdexcept>
#include <string>
#include <thread>

#include "support/notify_socket.h"
#include "support/temporary_folder.h"

namespace v3d::node {
namespace {

using ::testing::HasSubstr;
using ::testing::IsEmpty;

/// Makes the signals interrupt another thread than this one.
void let_another_thread_be_interrupted() {
  std::thread([] {
    for (;;) pause();
  }).detach();
  sigset_t signals;
  sigemptyset(&signals);
  sigaddset(&signals, SIGTERM);
  sigaddset(&signals, SIGINT);
  pthread_sigmask(SIG_BLOCK, &signals, nullptr);
}

/// Runs `work` in a child process, because the effect of the signal is permanent, and sends it
/// `signal` when it catches signals; 0: none. Returns the exit status: 0 if `work` returned true.
int status_of(bool (*work)(), int signal) {
  std::array<int, 2> ends{-1, -1};
  if (pipe(ends.data()) != 0) throw std::runtime_error("pipe");
  const pid_t pid = fork();
  if (pid == 0) {
    catch_stop_signals();
    let_another_thread_be_interrupted();
    if (write(ends[1], "r", 1) != 1) _exit(2);
    _exit(work() ? 0 : 1);
  }
  char ready = 0;
  EXPECT_EQ(read(ends[0], &ready, 1), 1);
  if (signal != 0) kill(pid, signal);
  int status = -1;
  waitpid(pid, &status, 0);
  for (const int end : ends) close(end);
  return WIFEXITED(status) ? WEXITSTATUS(status) : -1;
}

/// What a daemon with this $JOURNAL_STREAM and a studio file that is missing logs to its stderr, a
/// file. `own`: the variable names this file, as systemd does for the journal.
std::string logged_with(const std::string& journal_stream, bool own) {
  const int file = memfd_create("stderr", 0);
  const pid_t pid = fork();
  if (pid == 0) {
    dup2(file, STDERR_FILENO);
    struct stat state {};
    fstat(STDERR_FILENO, &state);
    const std::string name = std::to_string(state.st_dev) + ":" + std::to_string(state.st_ino);
    setenv("JOURNAL_STREAM", (own ? name : journal_stream).c_str(), 1);
    std::array<std::string, 5> words = {"v3d-captured", "--studio", "none.toml", "--node", "cap01"};
    std::array<char*, 5> arguments{};
    std::ranges::transform(words, arguments.begin(), [](std::string& word) { return word.data(); });
    _exit(daemon_main(words.size(), arguments.data(), {.name = words[0], .purpose = "-"},
                      [](const Studio&, const std::string&) {}));
  }
  int status = -1;
  waitpid(pid, &status, 0);
  EXPECT_EQ(WEXITSTATUS(status), 2);
  std::string text(1000, '\0');
  text.resize(static_cast<size_t>(std::max<ssize_t>(0, pread(file, text.data(), text.size(), 0))));
  close(file);
  return text;
}

TEST(Log, goes_to_stderr_unless_systemd_connected_it_with_the_journal) {
  const std::string line = "none.toml";
  EXPECT_THAT(logged_with("1:1", false), HasSubstr(line)) << "of a service that redirects stderr";
  EXPECT_THAT(logged_with("", false), HasSubstr(line));
  EXPECT_THAT(logged_with("journal", false), HasSubstr(line));
  EXPECT_THAT(logged_with("", true), IsEmpty());
}

TEST(WorkProgress, extends_the_start_and_feeds_the_watchdog_once_a_second) {
  const test::TemporaryFolder folder;
  test::NotifySocket systemd(folder / "notify");
  service::WorkProgress progress;
  for (int n = 0; n < 25; ++n) {
    progress.report(MonotonicInstant(n * std::chrono::milliseconds(100)));
    systemd.received();  // the socket holds few messages
  }
  EXPECT_EQ(systemd.count("EXTEND_TIMEOUT_USEC=900000000\n"), 3);
  EXPECT_EQ(systemd.count("WATCHDOG=1"), 3);
}

TEST(StopSignal, ends_the_wait_for_it) {
  // A missed signal would make it wait until the deadline and return false.
  const auto waits = [] { return stop_requested_by(Monotonic::now() + std::chrono::seconds(10)); };
  EXPECT_EQ(status_of(waits, SIGTERM), 0);
  EXPECT_EQ(status_of(waits, SIGINT), 0);
}

TEST(StopSignal, is_waited_for_until_the_deadline_only) {
  EXPECT_EQ(status_of([] { return stop_requested_by(Monotonic::now()); }, 0), 1);
}

}  // namespace
}  // namespace v3d::node
