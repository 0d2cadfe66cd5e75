// A program that a scenario starts and ends.
#pragma once

#include <sys/types.h>

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "base/core/time.h"

namespace v3d::test {

class ChildProcess {
 public:
  /// Standard output and standard error go to `log`.
  ChildProcess(const std::vector<std::string>& command, std::filesystem::path log);
  /// Kills it when it still runs.
  ~ChildProcess();
  ChildProcess(const ChildProcess&) = delete;
  ChildProcess& operator=(const ChildProcess&) = delete;

  pid_t pid() const { return pid_; }
  void signal(int number) const;
  bool runs();
  /// The exit status (128 + signal when it was killed); empty when it still runs at `deadline`.
  std::optional<int> wait(MonotonicInstant deadline);
  std::string output() const;

 private:
  const std::filesystem::path log_;
  pid_t pid_ = -1;
  std::optional<int> status_;
};

/// True once `condition()` holds, false when it does not until `deadline`.
template <class Condition>
bool becomes_true(Condition condition, MonotonicInstant deadline) {
  while (!condition()) {
    if (Monotonic::now() > deadline) return false;
    // A poll interval, not a guess at how long anything takes.
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
