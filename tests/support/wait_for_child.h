// The end of a forked child of a test.
#pragma once

#include <sys/wait.h>
#include <unistd.h>

#include <cerrno>
#include <csignal>

namespace v3d::test {

/// Exit status of a child that SIGKILL ended.
inline constexpr int kKilled = 128 + SIGKILL;

/// Waits for the end of a child. Returns its exit status (128 + signal when a signal ended it), and
/// -1 when `child` is no child of this process.
inline int wait_for_child(pid_t child) {
  int status = 0;
  while (waitpid(child, &status, 0) != child) {
    if (errno != EINTR) return -1;
  }
  return WIFEXITED(status) ? WEXITSTATUS(status) : 128 + WTERMSIG(status);
}

}  // namespace v3d::test
