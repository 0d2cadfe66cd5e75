#include "daemon/viewd/child_program.h"

#include <fcntl.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <csignal>

#include "base/core/error.h"
#include "base/io/process.h"

namespace v3d {
namespace {

constexpr int kCannotRun = 127;

}  // namespace

pid_t spawn_program(const std::vector<std::string>& arguments, int output, int errors) {
  return spawn_process(arguments, {.output = output,
                                   .errors = errors,
                                   .default_signals = true,
                                   .environment = {{"PATH=/usr/bin:/bin", "LC_ALL=C.UTF-8"}}});
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
    text.append(part.data(), std::min(static_cast<size_t>(got), kMaxOutput - text.size()));
  }
}

ChildProgram::ChildProgram(const std::vector<std::string>& arguments, MonotonicInstant deadline)
    : deadline_(deadline) {
  std::array<int, 2> output{-1, -1};
  std::array<int, 2> errors{-1, -1};
  if (pipe2(output.data(), O_CLOEXEC) == 0 && pipe2(errors.data(), O_CLOEXEC) == 0) {
    child_ = spawn_program(arguments, output[1], errors[1]);
  }
  if (child_ < 0) {
    end_ = {.status = kCannotRun, .errors = errno_message("cannot run " + arguments.front())};
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
  kill_process(child_);
}

void ChildProgram::enforce_deadline(MonotonicInstant now) {
  if (now < deadline_) return;
  kill(child_, now < deadline_ + kTerminationTimeout ? SIGTERM : SIGKILL);
  end_.timed_out = true;
}

std::optional<ProgramEnd> ChildProgram::poll(MonotonicInstant now) {
  output_.read_into(end_.output);
  errors_.read_into(end_.errors);
  if (child_ < 0) return end_;
  const std::optional<int> status = poll_process(child_);
  if (!status) {
    enforce_deadline(now);
    return {};
  }
  child_ = -1;
  output_.read_into(end_.output);  // its last arguments
  errors_.read_into(end_.errors);
  end_.status = *status;
  return end_;
}

}  // namespace v3d
