#include "common/subprocess.h"

#include <fcntl.h>
#include <spawn.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cerrno>
#include <stdexcept>

#include "base/error.h"

namespace v3d {
namespace {

std::string read_all(int fd) {
  std::string text;
  char chunk[4096];
  for (;;) {
    const ssize_t n = read(fd, chunk, sizeof chunk);
    if (n < 0 && errno == EINTR) continue;
    if (n <= 0) return text;
    text.append(chunk, static_cast<size_t>(n));
  }
}

/// The child's standard output goes to `to`.
pid_t spawn(const std::vector<std::string>& words, int to) {
  std::vector<char*> arguments;
  for (const std::string& word : words) arguments.push_back(const_cast<char*>(word.c_str()));
  arguments.push_back(nullptr);
  posix_spawn_file_actions_t actions;
  posix_spawn_file_actions_init(&actions);
  posix_spawn_file_actions_adddup2(&actions, to, STDOUT_FILENO);
  pid_t child = -1;
  const int error =
      posix_spawnp(&child, arguments[0], &actions, nullptr, arguments.data(), environ);
  posix_spawn_file_actions_destroy(&actions);
  if (error == 0) return child;
  errno = error;
  throw InputError(errno_message("cannot run " + words.front()));
}

int wait_for(pid_t child) {
  int status = 0;
  while (waitpid(child, &status, 0) < 0 && errno == EINTR) {
  }
  return WIFEXITED(status) ? WEXITSTATUS(status) : 128 + WTERMSIG(status);
}

}  // namespace

ProcessResult run_process(const std::vector<std::string>& words, Output output) {
  if (output == Output::kShow) {
    return {.status = wait_for(spawn(words, STDERR_FILENO)), .output = {}};
  }
  int channel[2];
  if (pipe2(channel, O_CLOEXEC) != 0) throw std::runtime_error(errno_message("pipe"));
  try {
    const pid_t child = spawn(words, channel[1]);
    close(channel[1]);
    std::string text = read_all(channel[0]);
    close(channel[0]);
    return {.status = wait_for(child), .output = std::move(text)};
  } catch (...) {
    close(channel[0]);
    close(channel[1]);
    throw;
  }
}

}  // namespace v3d
