// A child process that holds a lock of a take.
#pragma once

#include <sys/wait.h>
#include <unistd.h>

#include <csignal>
#include <stdexcept>
#include <string>

#include "base/io/unique_fd.h"
#include "take/take_lock.h"

namespace v3d::test {

class LockHolder {
 public:
  /// Returns when the process holds the lock. Throws std::runtime_error when it does not get it.
  LockHolder(const take::TakePaths& paths, const std::string& node)
      : LockHolder([&] { return take::TakeLock::acquire(paths, node); }) {}
  /// The same for what `acquire` returns in the process: false when it is not granted.
  template <class Acquire>
  explicit LockHolder(Acquire acquire) {
    int ends[2];
    if (pipe(ends) != 0) throw std::runtime_error("pipe");
    const io::UniqueFd reader(ends[0]);
    io::UniqueFd writer(ends[1]);
    pid_ = fork();
    if (pid_ == 0) hold(acquire, writer.get());
    writer.reset();
    char held = 0;
    if (read(reader.get(), &held, 1) != 1) throw std::runtime_error("the lock was not granted");
  }
  ~LockHolder() { kill(); }
  LockHolder(const LockHolder&) = delete;
  LockHolder& operator=(const LockHolder&) = delete;

  pid_t pid() const { return pid_; }
  /// Kills the process, as in a crash: its lock file stays.
  void kill() {
    if (pid_ <= 0) return;
    ::kill(pid_, SIGKILL);
    waitpid(pid_, nullptr, 0);
    pid_ = -1;
  }

 private:
  template <class Acquire>
  [[noreturn]] static void hold(const Acquire& acquire, int report) {
    const auto lock = acquire();
    if (!lock || write(report, "x", 1) != 1) _exit(1);
    for (;;) pause();
  }

  pid_t pid_ = -1;
};

}  // namespace v3d::test
