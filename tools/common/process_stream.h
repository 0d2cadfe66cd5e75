// Another program that is fed, or listened to, while it runs.
#pragma once

#include <sys/types.h>

#include <cstdint>
#include <span>
#include <string>
#include <vector>

namespace v3d {

/// Our end of its standard input, or of its standard output; its other streams are /dev/null and
/// our standard error. Killed where it still runs when this ends. One thread.
class ProcessStream {
 public:
  enum class End : uint8_t { kItsInput, kItsOutput };
  /// `words`: the program, found on the PATH, and its arguments. Throws InputError when there is no
  /// such program.
  ProcessStream(const std::vector<std::string>& words, End end);
  ~ProcessStream();
  ProcessStream(const ProcessStream&) = delete;
  ProcessStream& operator=(const ProcessStream&) = delete;

  /// False when it no longer reads.
  bool write(std::span<const uint8_t> bytes) const;
  /// False when it ended before so many bytes.
  bool read(std::span<uint8_t> bytes) const;
  /// No more is written or read; waits for its end. Its exit status; 128 + signal when one ended
  /// it.
  int finish();

 private:
  pid_t child_ = -1;
  int fd_ = -1;
};

}  // namespace v3d
