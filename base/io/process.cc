#include "base/io/process.h"

#include <fcntl.h>
#include <pthread.h>
#include <sched.h>
#include <spawn.h>
#include <sys/mman.h>
#include <sys/resource.h>
#include <sys/syscall.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <charconv>
#include <csignal>
#include <cstdint>
#include <fstream>
#include <limits>
#include <string>

#include "base/io/unique_fd.h"

namespace v3d {
namespace {

constexpr int kUnknownStatus = 127;

/// A null-terminated array for exec(3). The pointers refer to `words`.
std::vector<char*> pointers_to(const std::vector<std::string>& words) {
  std::vector<char*> pointers;
  for (const std::string& word : words) pointers.push_back(const_cast<char*>(word.c_str()));
  pointers.push_back(nullptr);
  return pointers;
}

class FileActions {
 public:
  FileActions() { posix_spawn_file_actions_init(&actions_); }
  ~FileActions() { posix_spawn_file_actions_destroy(&actions_); }
  FileActions(const FileActions&) = delete;
  FileActions& operator=(const FileActions&) = delete;

  void connect(int fd, int target) {
    if (fd >= 0) {
      posix_spawn_file_actions_adddup2(&actions_, fd, target);
    } else {
      posix_spawn_file_actions_addopen(&actions_, target, "/dev/null", O_RDWR, 0);
    }
  }
  /// Closes all descriptors above 2: not every library opens its files close-on-exec.
  void close_others() { posix_spawn_file_actions_addclosefrom_np(&actions_, STDERR_FILENO + 1); }
  const posix_spawn_file_actions_t* get() const { return &actions_; }

 private:
  posix_spawn_file_actions_t actions_{};
};

class Attributes {
 public:
  explicit Attributes(bool default_signals) {
    posix_spawnattr_init(&attributes_);
    if (!default_signals) return;
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

/// Converts a status of waitpid(2).
int exit_status(int status) {
  return WIFEXITED(status) ? WEXITSTATUS(status) : 128 + WTERMSIG(status);
}

pid_t wait_for(pid_t child, int& status, int flags) {
  return io::uninterrupted([&] { return waitpid(child, &status, flags); });
}

}  // namespace

pid_t spawn_process(const std::vector<std::string>& words, const SpawnOptions& options) {
  FileActions actions;
  actions.connect(options.output, STDOUT_FILENO);
  actions.connect(options.errors, STDERR_FILENO);
  actions.connect(options.input, STDIN_FILENO);
  actions.close_others();
  const Attributes attributes(options.default_signals);
  const std::vector<char*> arguments = pointers_to(words);
  std::vector<char*> variables;
  if (options.environment) variables = pointers_to(*options.environment);
  const auto start = options.on_path ? posix_spawnp : posix_spawn;
  pid_t child = -1;
  const int error = start(&child, arguments[0], actions.get(), attributes.get(), arguments.data(),
                          options.environment ? variables.data() : environ);
  if (error == 0) return child;
  errno = error;
  return -1;
}

int wait_for_process(pid_t child) {
  int status = 0;
  return wait_for(child, status, 0) == child ? exit_status(status) : kUnknownStatus;
}

std::optional<int> poll_process(pid_t child) {
  int status = 0;
  const pid_t ended = wait_for(child, status, WNOHANG);
  if (ended == 0) return std::nullopt;
  return ended == child ? exit_status(status) : kUnknownStatus;
}

void kill_process(pid_t child) {
  if (child < 0) return;
  kill(child, SIGKILL);
  wait_for_process(child);
}

void exec_program(const std::string& path, const std::vector<std::string>& words) {
  execv(path.c_str(), pointers_to(words).data());
}

int64_t available_memory() {
  std::ifstream in("/proc/meminfo");
  std::string key;
  int64_t kibibytes = 0;
  for (std::string unit; in >> key >> kibibytes; std::getline(in, unit)) {
    if (key == "MemAvailable:") {
      return kibibytes * 1024;
    }
  }
  return std::numeric_limits<int64_t>::max();
}

void lock_memory() {
  rlimit limit{};
  // With a limit, later allocations would fail.
  if (getrlimit(RLIMIT_MEMLOCK, &limit) != 0 || limit.rlim_cur != RLIM_INFINITY) return;
  mlockall(MCL_CURRENT | MCL_FUTURE | MCL_ONFAULT);
}

namespace {

/// Of 1 to 99; low, so that threads with a configured priority run first.
constexpr int kPriority = 10;
constexpr uint64_t kShortestSliceNs = 100'000;

/// The kernel's struct sched_attr, first version. glibc 2.36 has neither the struct nor the call.
struct SchedulingAttributes {
  uint32_t size = sizeof(SchedulingAttributes);
  uint32_t policy = SCHED_OTHER;
  uint64_t flags = 0;
  int32_t nice = 0;
  uint32_t priority = 0;
  uint64_t runtime_ns = kShortestSliceNs;  ///< for SCHED_OTHER: the time slice
  uint64_t deadline_ns = 0;
  uint64_t period_ns = 0;
};

}  // namespace

std::vector<int> parse_processor_list(std::string_view text) {
  constexpr int kMaxProcessor = 4095;
  std::vector<int> processors;
  while (!text.empty()) {
    int range[2] = {};
    const char* const end = text.data() + text.size();
    auto parsed = std::from_chars(text.data(), end, range[0]);
    if (parsed.ec != std::errc()) return {};
    range[1] = range[0];
    if (parsed.ptr != end && *parsed.ptr == '-') {
      parsed = std::from_chars(parsed.ptr + 1, end, range[1]);
      if (parsed.ec != std::errc()) return {};
    }
    if (parsed.ptr != end && *parsed.ptr != ',') return {};
    if (range[0] < 0 || range[1] < range[0] || range[1] > kMaxProcessor) return {};
    for (int i = range[0]; i <= range[1]; ++i) processors.push_back(i);
    text.remove_prefix(static_cast<size_t>(std::min(parsed.ptr + 1, end) - text.data()));
  }
  return processors;
}

std::vector<int> processors_for(IsolatedTask task, std::vector<int> isolated) {
  if (isolated.empty()) return {};
  if (task == IsolatedTask::kTrigger) return {isolated.back()};
  isolated.pop_back();
  return isolated;
}

void use_isolated_processors(IsolatedTask task) {
  std::string text;
  std::getline(std::ifstream("/sys/devices/system/cpu/isolated"), text);
  cpu_set_t set;
  CPU_ZERO(&set);
  for (const int processor : processors_for(task, parse_processor_list(text))) {
    if (processor < CPU_SETSIZE) CPU_SET(processor, &set);
  }
  if (CPU_COUNT(&set) > 0) pthread_setaffinity_np(pthread_self(), sizeof set, &set);
}

void make_thread_realtime() {
  use_isolated_processors(IsolatedTask::kTrigger);
  sched_param parameters{};
  parameters.sched_priority = kPriority;
  if (pthread_setschedparam(pthread_self(), SCHED_FIFO, &parameters) == 0) return;
  SchedulingAttributes attributes;
  attributes.nice = getpriority(PRIO_PROCESS, 0);
  syscall(SYS_sched_setattr, 0, &attributes, 0);
}

bool thread_sleeps(pid_t thread) {
  std::string text;
  std::getline(std::ifstream("/proc/self/task/" + std::to_string(thread) + "/stat"), text);
  // "<id> (<name>) <state> ...": a name may contain parentheses.
  const size_t name_end = text.rfind(") ");
  return name_end == std::string::npos || text.at(name_end + 2) != 'R';
}

}  // namespace v3d
