#include "faulty_program.h"

#include <fcntl.h>
#include <spawn.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <csignal>
#include <cstdlib>
#include <fstream>
#include <iterator>
#include <sstream>
#include <stdexcept>

#include "base/core/time.h"
#include "base/io/file.h"
#include "mapped_report.h"
#include "support/temporary_folder.h"

namespace v3d::test {
namespace {

namespace fs = std::filesystem;

/// A run takes 0.15 s. While other programs write gigabytes, the kernel slows every writer down.
constexpr Duration kMaxRunTime = std::chrono::minutes(3);

std::vector<char*> pointers(const std::vector<std::string>& texts) {
  std::vector<char*> pointers;
  for (const std::string& text : texts) pointers.push_back(const_cast<char*>(text.c_str()));
  pointers.push_back(nullptr);
  return pointers;
}

pid_t spawn(const std::vector<std::string>& command, const std::vector<std::string>& environment,
            const fs::path& out, const fs::path& err) {
  posix_spawn_file_actions_t files;
  posix_spawn_file_actions_init(&files);
  constexpr int kWrite = O_WRONLY | O_CREAT | O_TRUNC;
  posix_spawn_file_actions_addopen(&files, STDIN_FILENO, "/dev/null", O_RDONLY, 0);
  posix_spawn_file_actions_addopen(&files, STDOUT_FILENO, out.c_str(), kWrite, 0644);
  posix_spawn_file_actions_addopen(&files, STDERR_FILENO, err.c_str(), kWrite, 0644);
  pid_t child = -1;
  const int error = posix_spawn(&child, command[0].c_str(), &files, nullptr,
                                pointers(command).data(), pointers(environment).data());
  posix_spawn_file_actions_destroy(&files);
  if (error != 0) throw std::runtime_error("cannot run " + command[0]);
  return child;
}

/// One line for every process that started at the same time as `child` or later: number, name,
/// state, and the system call and the kernel function that it is in.
std::string describe_processes_since(pid_t child) {
  std::ostringstream text;
  for (const auto& entry : fs::directory_iterator("/proc")) {
    const int process = std::atoi(entry.path().filename().c_str());
    if (process < child) continue;
    const auto first_line = [&](const char* name) {
      std::ifstream file(entry.path() / name);
      std::string line;
      std::getline(file, line);
      return line;
    };
    std::string state = first_line("stat");
    state.resize(std::min<size_t>(state.size(), 60));
    text << "  " << state << "... system call " << first_line("syscall") << ", in "
         << first_line("wchan") << "\n";
  }
  return text.str();
}

/// Waits for the end of `child`. After kMaxRunTime, kills it and appends to the file `err` what it
/// waited for.
int wait_for(pid_t child, const fs::path& err) {
  const MonotonicInstant deadline = Monotonic::now() + kMaxRunTime;
  for (int status = 0;;) {
    if (waitpid(child, &status, WNOHANG) == child) {
      return WIFSIGNALED(status) ? 128 + WTERMSIG(status) : WEXITSTATUS(status);
    }
    if (Monotonic::now() > deadline) {
      std::ofstream(err, std::ios::app)
          << "killed after "
          << std::chrono::duration_cast<std::chrono::seconds>(kMaxRunTime).count()
          << " s; processes at that time:\n"
          << describe_processes_since(child);
      kill(child, SIGKILL);
      waitpid(child, &status, 0);
      return -1;
    }
    const timespec poll_interval{0, 500'000};
    nanosleep(&poll_interval, nullptr);
  }
}

}  // namespace

bool names_path_and_cause(const std::string& line, const std::string& cause) {
  const bool names_file = line.find('/') != std::string::npos ||
                          line.find(".toml") != std::string::npos ||
                          line.find(".lcmlog") != std::string::npos;
  return names_file && line.find(cause) != std::string::npos;
}

bool ProgramResult::reports(const std::string& cause) const {
  std::istringstream lines(err + "\n" + out);
  for (std::string line; std::getline(lines, line);) {
    if (names_path_and_cause(line, cause)) return true;
  }
  return false;
}

std::vector<std::string> injector_variables(const fs::path& prefix, const fs::path& report) {
  return {"LD_PRELOAD=" V3D_FAULT_INJECTOR, "V3D_FAULT_PREFIX=" + prefix.string(),
          "V3D_FAULT_REPORT=" + report.string()};
}

std::vector<std::string> variables_of(const Fault& fault) {
  return {"V3D_FAULT_CALL=" + fault.call, "V3D_FAULT_KIND=" + fault.kind,
          "V3D_FAULT_NUMBER=" + std::to_string(fault.number),
          fault.lasts ? "V3D_FAULT_LASTS=1" : "V3D_FAULT_LASTS=0",
          "V3D_FAULT_PROGRAM=" + fault.program};
}

FaultyWorkplace::FaultyWorkplace(fs::path root) : root_(std::move(root)) { clear(); }

void FaultyWorkplace::clear() const {
  fs::remove_all(disk());
  fs::create_directories(disk());
  fs::remove(marks());
  fs::remove(trace());
}

std::vector<std::string> FaultyWorkplace::marked() const {
  std::vector<std::string> marks;
  if (!fs::exists(this->marks())) return marks;
  std::istringstream lines(read_file(this->marks()));
  for (std::string line; std::getline(lines, line) && line != kPowerCutMark;) {
    marks.push_back(line);
  }
  return marks;
}

ProgramResult FaultyWorkplace::run(const std::vector<std::string>& command,
                                   const Fault& fault) const {
  return run_with(command, variables_of(fault));
}

ProgramResult FaultyWorkplace::run_traced(const std::vector<std::string>& command) const {
  return run_with(command, {"V3D_FAULT_TRACE=" + trace().string()});
}

ProgramResult FaultyWorkplace::run_with(const std::vector<std::string>& command,
                                        std::vector<std::string> environment) const {
  const MappedReport report(root_ / "report");
  std::ranges::move(injector_variables(disk(), root_ / "report"), std::back_inserter(environment));
  environment.push_back("V3D_FAULT_MARKS=" + marks().string());
  for (char** variable = environ; *variable != nullptr; ++variable) {
    environment.emplace_back(*variable);
  }
  const fs::path out = root_ / "out", err = root_ / "err";
  ProgramResult result;
  result.status = wait_for(spawn(command, environment, out, err), err);
  result.out = read_file(out);
  result.err = read_file(err);
  report.read(result);
  return result;
}

void copy_tree(const fs::path& from, const fs::path& to) {
  fs::create_directories(to);
  for (const auto& entry : fs::directory_iterator(from)) {
    const fs::path place = to / entry.path().filename();
    if (entry.is_directory()) {
      copy_tree(entry.path(), place);
    } else {
      fs::copy_file(entry.path(), place);
      fs::last_write_time(place, entry.last_write_time());
    }
  }
  fs::last_write_time(to, fs::last_write_time(from));
}

std::map<std::string, std::string> contents_of(const fs::path& folder) {
  std::map<std::string, std::string> contents;
  if (!fs::exists(folder)) return contents;
  for (const auto& entry : fs::recursive_directory_iterator(folder)) {
    if (!entry.is_regular_file()) continue;
    contents[entry.path().lexically_relative(folder)] = read_file(entry.path());
  }
  return contents;
}

}  // namespace v3d::test
