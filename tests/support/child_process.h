// A child process of a test.
#pragma once

#include <sys/types.h>

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "base/core/time.h"

namespace v3d::test {

/// Not thread-safe. The child is killed when its parent thread ends.
class ChildProcess {
 public:
  /// Starts `command`, whose first part is the path of a program. Standard output and standard
  /// error are appended to `log`.
  ChildProcess(const std::vector<std::string>& command, std::filesystem::path log);
  /// Kills the process when it still runs. Fails the test when its log has a report of a sanitizer.
  ~ChildProcess();
  ChildProcess(const ChildProcess&) = delete;
  ChildProcess& operator=(const ChildProcess&) = delete;

  pid_t pid() const { return pid_; }
  void signal(int number) const;
  bool runs();
  /// Waits for the exit status (128 + signal when it was killed); empty when it still runs at
  /// `deadline`.
  std::optional<int> wait(MonotonicInstant deadline);
  /// The contents of the log.
  std::string output() const;

 private:
  const std::filesystem::path log_;
  pid_t pid_ = -1;
  std::optional<int> status_;
};

/// Polls every 10 ms. True once `condition()` holds, false when it does not hold until `deadline`.
template <class Condition>
bool becomes_true(Condition condition, MonotonicInstant deadline) {
  while (!condition()) {
    if (Monotonic::now() > deadline) return false;
    struct timespec pause {
      0, 10'000'000
    };
    nanosleep(&pause, nullptr);
  }
  return true;
}

inline MonotonicInstant within(int seconds) {
  return Monotonic::now() + std::chrono::seconds(seconds);
}

}  // namespace v3d::test
