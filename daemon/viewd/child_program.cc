#include "daemon/viewd/child_program.h"

#include <fcntl.h>
#include <spawn.h>
#include <sys/wait.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <csignal>

#include "base/error.h"

namespace v3d {
namespace {

constexpr int kCannotRun = 127;

/// Of ours nothing: where systemd is told of readiness, for one, is not its business.
std::array<char*, 3> environment() {
  static char path[] = "PATH=/usr/bin:/bin";
  static char language[] = "LC_ALL=C.UTF-8";
  return {path, language, nullptr};
}

/// What a program inherits: all signals as they are by default.
class Attributes {
 public:
  Attributes() {
    posix_spawnattr_init(&attributes_);
    posix_spawnattr_setflags(&attributes_, POSIX_SPAWN_SETSIGMASK | POSIX_SPAWN_SETSIGDEF);
    sigset_t set;
    sigemptyset(&set);
    posix_spawnattr_setsigmask(&attributes_, &set);
    sigfillset(&set);
    posix_spawnattr_setsigdefault(&attributes_, &set);
  }
  ~Attributes() { posix_spawnattr_destroy(&attributes_); }
  Attributes(const Attributes&) = delete;
  Attributes& operator=(const Attributes&) = delete;
  const posix_spawnattr_t* get() const { return &attributes_; }

 private:
  posix_spawnattr_t attributes_{};
};

}  // namespace

pid_t spawn_program(const std::vector<std::string>& words, int output, int errors) {
  std::vector<char*> arguments;
  for (const std::string& word : words) arguments.push_back(const_cast<char*>(word.c_str()));
  arguments.push_back(nullptr);
  posix_spawn_file_actions_t actions;
  posix_spawn_file_actions_init(&actions);
  posix_spawn_file_actions_addopen(&actions, STDIN_FILENO, "/dev/null", O_RDONLY, 0);
  posix_spawn_file_actions_adddup2(&actions, output, STDOUT_FILENO);
  posix_spawn_file_actions_adddup2(&actions, errors, STDERR_FILENO);
  // Not every library opens its sockets so that they close by themselves.
  posix_spawn_file_actions_addclosefrom_np(&actions, STDERR_FILENO + 1);
  const Attributes attributes;
  pid_t child = -1;
  const int error = posix_spawn(&child, arguments[0], &actions, attributes.get(), arguments.data(),
                                environment().data());
  posix_spawn_file_actions_destroy(&actions);
  if (error == 0) return child;
  errno = error;
  return -1;
}

void end_program(pid_t child) {
  if (child < 0) return;
  kill(child, SIGKILL);
  while (waitpid(child, nullptr, 0) < 0 && errno == EINTR) {
  }
}

void ChildProgram::Pipe::close() {
  if (fd >= 0) ::close(fd);
  fd = -1;
}

void ChildProgram::Pipe::read_into(std::string& text) {
  std::array<char, 4096> part{};
  while (fd >= 0) {
    const ssize_t got = read(fd, part.data(), part.size());
    if (got < 0 && errno == EINTR) continue;
    if (got < 0 && errno == EAGAIN) return;
    if (got <= 0) return close();
    text.append(part.data(), std::min(static_cast<size_t>(got), kMostOutput - text.size()));
  }
}

ChildProgram::ChildProgram(const std::vector<std::string>& words, MonotonicInstant deadline)
    : deadline_(deadline) {
  std::array<int, 2> output{-1, -1};
  std::array<int, 2> errors{-1, -1};
  if (pipe2(output.data(), O_CLOEXEC) == 0 && pipe2(errors.data(), O_CLOEXEC) == 0) {
    child_ = spawn_program(words, output[1], errors[1]);
  }
  if (child_ < 0) {
    end_ = {.status = kCannotRun, .errors = errno_message("cannot run " + words.front())};
  }
  for (const int fd : {output[1], errors[1]}) {
    if (fd >= 0) ::close(fd);
  }
  output_.fd = output[0];
  errors_.fd = errors[0];
  for (const int fd : {output_.fd, errors_.fd}) {
    if (fd >= 0) fcntl(fd, F_SETFL, O_NONBLOCK);
  }
}

ChildProgram::~ChildProgram() {
  output_.close();
  errors_.close();
  end_program(child_);
}

void ChildProgram::hurry(MonotonicInstant now) {
  if (now < deadline_) return;
  kill(child_, now < deadline_ + kEndsWithin ? SIGTERM : SIGKILL);
  end_.timed_out = true;
}

std::optional<ProgramEnd> ChildProgram::poll(MonotonicInstant now) {
  output_.read_into(end_.output);
  errors_.read_into(end_.errors);
  if (child_ < 0) return end_;
  int status = 0;
  if (waitpid(child_, &status, WNOHANG) != child_) {
    hurry(now);
    return {};
  }
  child_ = -1;
  output_.read_into(end_.output);  // its last words
  errors_.read_into(end_.errors);
  end_.status = WIFEXITED(status) ? WEXITSTATUS(status) : 128 + WTERMSIG(status);
  return end_;
}

}  // namespace v3d
