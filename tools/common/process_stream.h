// A child process with a stream to its standard input or from its standard output.
#pragma once

#include <sys/types.h>

#include <cstdint>
#include <span>
#include <string>
#include <vector>

namespace v3d {

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
  int fd_ = -1;
};

}  // namespace v3d
