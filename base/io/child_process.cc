#include "base/io/child_process.h"

#include <fcntl.h>
#include <sys/mman.h>
#include <sys/socket.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <csignal>
#include <cstdlib>
#include <sstream>
#include <stdexcept>
#include <utility>

#include "base/core/error.h"
#include "base/io/process.h"

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

pid_t start(const std::vector<std::string>& words, int output, int errors) {
  const pid_t child = spawn_process(words, {.output = output, .errors = errors, .on_path = true});
  if (child < 0) throw InputError(errno_message("cannot run " + words.front()));
  return child;
}

ProcessResult run_captured(const std::vector<std::string>& words, int errors) {
  int channel[2];
  if (pipe2(channel, O_CLOEXEC) != 0) throw std::runtime_error(errno_message("pipe"));
  const io::UniqueFd ours(channel[0]);
  io::UniqueFd its(channel[1]);
  const pid_t child = start(words, its.get(), errors);
  its.reset();
  std::string text = read_all(ours.get());
  return {.status = wait_for_process(child), .output = std::move(text), .errors = {}};
}

}  // namespace

ProcessResult run_process(const std::vector<std::string>& words, Output output) {
  if (output == Output::kShow) {
    const pid_t child = start(words, STDERR_FILENO, STDERR_FILENO);
    return {.status = wait_for_process(child), .output = {}, .errors = {}};
  }
  if (output == Output::kCapture) return run_captured(words, STDERR_FILENO);
  // A file instead of a second pipe: the program would block on a full pipe that is not read.
  const io::UniqueFd errors(memfd_create("errors", MFD_CLOEXEC));
  if (!errors) throw std::runtime_error(errno_message("cannot run another program"));
  ProcessResult result = run_captured(words, errors.get());
  lseek(errors.get(), 0, SEEK_SET);
  result.errors = read_all(errors.get());
  return result;
}

bool has_program(const std::string& name) {
  const char* path = std::getenv("PATH");
  std::istringstream folders(path != nullptr ? path : "/usr/bin:/bin");
  for (std::string folder; std::getline(folders, folder, ':');) {
    if (access((folder + "/" + name).c_str(), X_OK) == 0) return true;
  }
  return false;
}

ProcessStream::ProcessStream(const std::vector<std::string>& words, End end) {
  // A socket instead of a pipe: writing without a reader returns an error and raises no signal.
  int channel[2];
  if (socketpair(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0, channel) != 0) {
    throw std::runtime_error(errno_message("socketpair"));
  }
  fd_.reset(channel[0]);
  const io::UniqueFd of_child(channel[1]);
  SpawnOptions options{.errors = STDERR_FILENO, .on_path = true};
  (end == End::kStdin ? options.input : options.output) = of_child.get();
  child_ = spawn_process(words, options);
  if (child_ < 0) throw InputError(errno_message("cannot run " + words.front()));
}

ProcessStream::~ProcessStream() {
  if (child_ < 0) return;
  fd_.reset();
  kill_process(child_);
}

bool ProcessStream::write(std::span<const uint8_t> bytes) const {
  while (!bytes.empty()) {
    const ssize_t n = send(fd_.get(), bytes.data(), bytes.size(), MSG_NOSIGNAL);
    if (n < 0 && errno == EINTR) continue;
    if (n <= 0) return false;
    bytes = bytes.subspan(static_cast<size_t>(n));
  }
  return true;
}

bool ProcessStream::read(std::span<uint8_t> bytes) const {
  while (!bytes.empty()) {
    const ssize_t n = ::read(fd_.get(), bytes.data(), bytes.size());
    if (n < 0 && errno == EINTR) continue;
    if (n <= 0) return false;
    bytes = bytes.subspan(static_cast<size_t>(n));
  }
  return true;
}

int ProcessStream::finish() {
  fd_.reset();
  return wait_for_process(std::exchange(child_, -1));
}

namespace {

constexpr int kCannotRun = 127;

}  // namespace

pid_t spawn_program(const std::vector<std::string>& arguments, int output, int errors) {
  return spawn_process(arguments, {.output = output,
                                   .errors = errors,
                                   .default_signals = true,
                                   .environment = {{"PATH=/usr/bin:/bin", "LC_ALL=C.UTF-8"}}});
}

void ChildProgram::Pipe::read_into(std::string& text) {
  std::array<char, 4096> part{};
  while (fd) {
    const ssize_t got = read(fd.get(), part.data(), part.size());
    if (got < 0 && errno == EINTR) continue;
    if (got < 0 && errno == EAGAIN) return;
    if (got <= 0) return fd.reset();
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
  output_.fd.reset(output[0]);
  errors_.fd.reset(errors[0]);
  const io::UniqueFd output_of_child(output[1]), errors_of_child(errors[1]);
  if (child_ < 0) {
    end_ = {.status = kCannotRun, .errors = errno_message("cannot run " + arguments.front())};
  }
  for (const int fd : {output[0], errors[0]}) {
    if (fd >= 0) fcntl(fd, F_SETFL, O_NONBLOCK);
  }
}

ChildProgram::~ChildProgram() {
  output_.fd.reset();
  errors_.fd.reset();
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
