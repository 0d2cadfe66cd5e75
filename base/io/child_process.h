// Child processes: run to the end, read or written as a stream, run with a deadline.
#pragma once

#include <sys/types.h>

#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "base/core/time.h"
#include "base/io/unique_fd.h"

namespace v3d {

// Runs a program and waits for its end.

/// Result of a finished program.
struct ProcessResult {
  int status = 0;      ///< exit status, or 128 + signal
  std::string output;  ///< standard output, if captured
  std::string errors;  ///< standard error, if captured
};

/// Output of the program. kCapture returns its standard output; kShow writes it to standard error
/// of this process, because standard output is reserved for results. kCaptureBoth returns standard
/// error, too.
enum class Output { kCapture, kShow, kCaptureBoth };

/// Runs the program with empty standard input. `words`: its name, searched in PATH, and its
/// arguments. Throws InputError when there is no such program.
ProcessResult run_process(const std::vector<std::string>& words, Output output);

/// True when PATH contains such a program.
bool has_program(const std::string& name);

// A child process with a stream to its standard input or from its standard output.

/// A running child process and one end of its standard input or output.
///
/// The other one of these is /dev/null; standard error is that of this process. The destructor
/// kills a child that still runs. One thread.
class ProcessStream {
 public:
  enum class End : uint8_t { kStdin, kStdout };
  /// Starts the program. `words`: its name, searched in PATH, and its arguments. Throws InputError
  /// when there is no such program.
  ProcessStream(const std::vector<std::string>& words, End end);
  ~ProcessStream();
  ProcessStream(const ProcessStream&) = delete;
  ProcessStream& operator=(const ProcessStream&) = delete;

  /// Writes all bytes. Returns false when the child no longer reads.
  bool write(std::span<const uint8_t> bytes) const;
  /// Fills `bytes`. Returns false when the output ends before.
  bool read(std::span<uint8_t> bytes) const;
  /// Closes the stream and waits for the end of the child. Returns its exit status, or 128 +
  /// signal.
  int finish();

 private:
  pid_t child_ = -1;
  io::UniqueFd fd_;
};

// A child process with captured output and a deadline.

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
    io::UniqueFd fd;
    void read_into(std::string& text);
  };
  void enforce_deadline(MonotonicInstant now);

  pid_t child_ = -1;  ///< -1: has ended
  Pipe output_, errors_;
  const MonotonicInstant deadline_;
  ProgramEnd end_;
};

}  // namespace v3d
