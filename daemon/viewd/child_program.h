// A child process with captured output and a deadline.
#pragma once

#include <sys/types.h>

#include <optional>
#include <string>
#include <vector>

#include "base/core/time.h"

namespace v3d {

struct ProgramEnd {
  int status = 0;  ///< exit status, or 128 + signal number
  bool timed_out = false;
  std::string output = {};
  std::string errors = {};
};

/// spawn_process() with a minimal environment (without systemd's notification socket), default
/// signals and no input. `arguments`: path of the program, and its arguments.
pid_t spawn_program(const std::vector<std::string>& arguments, int output, int errors);

/// A program started by spawn_program(). It gets SIGTERM at its deadline, and SIGKILL after
/// kTerminationTimeout. The first megabyte of each output is kept. One thread.
class ChildProgram {
 public:
  static constexpr size_t kMaxOutput = 1 << 20;
  static constexpr Duration kTerminationTimeout = std::chrono::seconds(2);

  /// `arguments`: path of the program, and its arguments. If it cannot be run, its status is 127.
  ChildProgram(const std::vector<std::string>& arguments, MonotonicInstant deadline);
  /// Kills the program if it still runs.
  ~ChildProgram();
  ChildProgram(const ChildProgram&) = delete;
  ChildProgram& operator=(const ChildProgram&) = delete;

  /// Reads its output. Returns the result once it has ended, else empty. Does not wait.
  std::optional<ProgramEnd> poll(MonotonicInstant now);

 private:
  struct Pipe {
    int fd = -1;
    void read_into(std::string& text);
    void close();
  };
  void enforce_deadline(MonotonicInstant now);

  pid_t child_ = -1;  ///< -1: has ended
  Pipe output_, errors_;
  const MonotonicInstant deadline_;
  ProgramEnd end_;
};

}  // namespace v3d
