#include "common/subprocess.h"

#include <fcntl.h>
#include <sys/mman.h>
#include <unistd.h>

#include <cerrno>
#include <cstdlib>
#include <sstream>
#include <stdexcept>
#include <utility>

#include "base/core/error.h"
#include "base/io/process.h"
#include "base/io/unique_fd.h"

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

}  // namespace v3d
