// Another program, run beside the work of this one.
#pragma once

#include <sys/types.h>

#include <optional>
#include <string>
#include <vector>

#include "base/time.h"

namespace v3d {

struct ProgramEnd {
  int status = 0;  ///< as a shell tells it: 128 + the signal when one ended it
  bool timed_out = false;
  std::string output = {};
  std::string errors = {};
};

/// spawn_process() with an environment of its own, in which systemd's notification socket is not,
/// no signal blocked, and nothing to read. `words`: a path, and the arguments.
pid_t spawn_program(const std::vector<std::string>& words, int output, int errors);

/// A spawn_program() that is asked to end (SIGTERM) at its deadline, and killed a little later. Of
/// what it prints the first megabyte is kept. One thread.
class ChildProgram {
 public:
  static constexpr size_t kMaxOutput = 1 << 20;
  static constexpr Duration kEndsWithin = std::chrono::seconds(2);

  /// `words`: a path, and the arguments. Where it cannot be run, that is how it ends: status 127.
  ChildProgram(const std::vector<std::string>& words, MonotonicInstant deadline);
  /// Kills what still runs.
  ~ChildProgram();
  ChildProgram(const ChildProgram&) = delete;
  ChildProgram& operator=(const ChildProgram&) = delete;

  /// Reads what it has printed; never waits. How it ended, once it has.
  std::optional<ProgramEnd> poll(MonotonicInstant now);

 private:
  struct Pipe {
    int fd = -1;
    void read_into(std::string& text);
    void close();
  };
  void hurry(MonotonicInstant now);

  pid_t child_ = -1;  ///< -1: it is over
  Pipe output_, errors_;
  const MonotonicInstant deadline_;
  ProgramEnd end_;
};

}  // namespace v3d
