#include "common/process_stream.h"

#include <sys/socket.h>
#include <unistd.h>

#include <cerrno>
#include <stdexcept>
#include <utility>

#include "base/core/error.h"
#include "base/io/process.h"

namespace v3d {
ProcessStream::ProcessStream(const std::vector<std::string>& words, End end) {
  // A socket instead of a pipe: writing without a reader returns an error and raises no signal.
  int channel[2];
  if (socketpair(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0, channel) != 0) {
    throw std::runtime_error(errno_message("socketpair"));
  }
  SpawnOptions options{.errors = STDERR_FILENO, .on_path = true};
  (end == End::kStdin ? options.input : options.output) = channel[1];
  child_ = spawn_process(words, options);
  const std::string problem = errno_message("cannot run " + words.front());
  close(channel[1]);
  fd_ = channel[0];
  if (child_ >= 0) return;
  close(fd_);
  throw InputError(problem);
}

ProcessStream::~ProcessStream() {
  if (child_ < 0) return;
  close(fd_);
  kill_process(child_);
}

bool ProcessStream::write(std::span<const uint8_t> bytes) const {
  while (!bytes.empty()) {
    const ssize_t n = send(fd_, bytes.data(), bytes.size(), MSG_NOSIGNAL);
    if (n < 0 && errno == EINTR) continue;
    if (n <= 0) return false;
    bytes = bytes.subspan(static_cast<size_t>(n));
  }
  return true;
}

bool ProcessStream::read(std::span<uint8_t> bytes) const {
  while (!bytes.empty()) {
    const ssize_t n = ::read(fd_, bytes.data(), bytes.size());
    if (n < 0 && errno == EINTR) continue;
    if (n <= 0) return false;
    bytes = bytes.subspan(static_cast<size_t>(n));
  }
  return true;
}

int ProcessStream::finish() {
  close(fd_);
  return wait_for_process(std::exchange(child_, -1));
}

}  // namespace v3d
