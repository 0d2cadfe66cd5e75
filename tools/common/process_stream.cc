#include "common/process_stream.h"

#include <fcntl.h>
#include <spawn.h>
#include <sys/socket.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cerrno>
#include <csignal>
#include <stdexcept>

#include "base/error.h"

namespace v3d {
namespace {

pid_t spawn(const std::vector<std::string>& words, int input, int output, int* error) {
  std::vector<char*> arguments;
  for (const std::string& word : words) arguments.push_back(const_cast<char*>(word.c_str()));
  arguments.push_back(nullptr);
  posix_spawn_file_actions_t actions;
  posix_spawn_file_actions_init(&actions);
  posix_spawn_file_actions_adddup2(&actions, input, STDIN_FILENO);
  posix_spawn_file_actions_adddup2(&actions, output, STDOUT_FILENO);
  pid_t child = -1;
  *error = posix_spawnp(&child, arguments[0], &actions, nullptr, arguments.data(), environ);
  posix_spawn_file_actions_destroy(&actions);
  return child;
}

}  // namespace

ProcessStream::ProcessStream(const std::vector<std::string>& words, End end) {
  // A socket, not a pipe: writing to one that nobody reads is an error, not a signal.
  int channel[2];
  if (socketpair(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0, channel) != 0) {
    throw std::runtime_error(errno_message("socketpair"));
  }
  const int nothing = open("/dev/null", O_RDWR | O_CLOEXEC);
  int error = 0;
  child_ = end == End::kItsInput ? spawn(words, channel[1], nothing, &error)
                                 : spawn(words, nothing, channel[1], &error);
  close(nothing);
  close(channel[1]);
  fd_ = channel[0];
  if (error == 0) return;
  close(fd_);
  errno = error;
  throw InputError(errno_message("cannot run " + words.front()));
}

ProcessStream::~ProcessStream() {
  if (child_ < 0) return;
  kill(child_, SIGKILL);
  finish();
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
  int status = 0;
  while (waitpid(child_, &status, 0) < 0 && errno == EINTR) {
  }
  child_ = -1;
  return WIFEXITED(status) ? WEXITSTATUS(status) : 128 + WTERMSIG(status);
}

}  // namespace v3d
