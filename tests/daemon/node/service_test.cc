#include "daemon/node/service.h"

#include <gtest/gtest.h>
#include <sys/wait.h>
#include <unistd.h>

#include <array>
#include <csignal>
#include <stdexcept>
#include <thread>

namespace v3d::node {
namespace {

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
