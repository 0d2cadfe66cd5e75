#include "support/child_process.h"

#include <fcntl.h>
#include <gtest/gtest.h>
#include <sys/prctl.h>
#include <sys/wait.h>
#include <unistd.h>

#include <csignal>

#include "base/io/file.h"
#include "support/priority.h"

namespace v3d::test {

ChildProcess::ChildProcess(const std::vector<std::string>& command, std::filesystem::path log)
    : log_(std::move(log)) {
  std::vector<char*> arguments;
  for (const std::string& part : command) arguments.push_back(const_cast<char*>(part.c_str()));
  arguments.push_back(nullptr);
  const int fd = open(log_.c_str(), O_WRONLY | O_CREAT | O_APPEND | O_CLOEXEC, 0644);
  const int nice = nice_of(command);
  pid_ = fork();
  if (pid_ == 0) {
    prctl(PR_SET_PDEATHSIG, SIGKILL);
    setpriority(PRIO_PROCESS, 0, nice);
    dup2(fd, STDOUT_FILENO);
    dup2(fd, STDERR_FILENO);
    execv(arguments[0], arguments.data());
    _exit(127);
  }
  close(fd);
}

ChildProcess::~ChildProcess() {
  if (runs()) {
    signal(SIGKILL);
    wait(within(10));
  }
  // ThreadSanitizer continues after a report, so a killed process has no exit status that shows it.
  const io::Result<std::string> text = io::read_file(log_);
  if (text && text->find("Sanitizer: ") != std::string::npos) {
    ADD_FAILURE() << log_.string() << " has a report of a sanitizer:\n" << *text;
  }
}

void ChildProcess::signal(int number) const { kill(pid_, number); }

bool ChildProcess::runs() {
  int status = 0;
  if (!status_ && waitpid(pid_, &status, WNOHANG) == pid_) {
    status_ = WIFEXITED(status) ? WEXITSTATUS(status) : 128 + WTERMSIG(status);
  }
  return !status_;
}

std::optional<int> ChildProcess::wait(MonotonicInstant deadline) {
  becomes_true([&] { return !runs(); }, deadline);
  return status_;
}

std::string ChildProcess::output() const { return read_file(log_); }

}  // namespace v3d::test
