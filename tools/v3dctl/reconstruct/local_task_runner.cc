#include "v3dctl/reconstruct/local_task_runner.h"

#include <fcntl.h>
#include <unistd.h>

#include <algorithm>
#include <csignal>
#include <ctime>
#include <filesystem>
#include <stdexcept>

#include "base/error.h"
#include "base/io/process.h"
#include "base/time.h"

namespace v3d::ctl {
namespace {

/// Of each process, so that the last ones to end have little left; but each task begins by learning
/// what the segmentation had learnt until there.
constexpr int64_t kTasksOfAProcess = 3;
constexpr auto kPatience = std::chrono::seconds(5);

void pause() {
  const timespec look_again{0, 50'000'000};
  nanosleep(&look_again, nullptr);  // a child that ends, or Ctrl-C, cuts it short
}

/// A process that reads nothing and writes to `log` alone.
pid_t start_task(const std::vector<std::string>& words, const std::filesystem::path& log) {
  const int output = open(log.c_str(), O_WRONLY | O_CREAT | O_APPEND | O_CLOEXEC, 0644);
  if (output < 0) throw std::runtime_error(errno_message(log.string()));
  const pid_t child = spawn_process(words, {.output = output, .errors = output});
  const std::string problem = errno_message("cannot run " + words.front());
  close(output);
  if (child < 0) throw std::runtime_error(problem);
  return child;
}

}  // namespace

std::vector<std::string> task_words(const std::string& folder, const std::string& range,
                                    int threads) {
  const std::string program = std::filesystem::read_symlink("/proc/self/exe");
  return {program, "reconstruct-shards", folder, range, "--threads", std::to_string(threads)};
}

LocalTasks::LocalTasks(PieceFolder folder, int processes, int threads)
    : folder_(std::move(folder)), processes_(static_cast<size_t>(processes)), threads_(threads) {}

LocalTasks::~LocalTasks() { cancel(); }

void LocalTasks::start(const std::vector<int64_t>& missing, int64_t) {
  const auto tasks = kTasksOfAProcess * static_cast<int64_t>(processes_);
  const int64_t most = (std::ssize(missing) + tasks - 1) / tasks;
  for (const int64_t place : missing) {
    const bool goes_on =
        !waiting_.empty() && waiting_.back().end == place && place - waiting_.back().begin < most;
    if (!goes_on) waiting_.push_back({place, place});
    waiting_.back().end = place + 1;
  }
}

void LocalTasks::begin(const Task& task) {
  const std::string first = std::to_string(task.begin);
  std::vector<std::string> words =
      task_words(folder_.path(), first + ":" + std::to_string(task.end), threads_);
  words.insert(words.end(), {"--parent", std::to_string(getpid())});
  running_.push_back(start_task(words, folder_.path() / ("task-" + first + ".log")));
}

bool LocalTasks::runs() {
  reap();
  for (; running_.size() < processes_ && !waiting_.empty(); waiting_.pop_front()) {
    begin(waiting_.front());
  }
  if (running_.empty()) return false;
  pause();
  return true;
}

void LocalTasks::reap() {
  std::erase_if(running_, [](pid_t child) { return poll_process(child).has_value(); });
}

void LocalTasks::signal(int number) const {
  for (const pid_t child : running_) kill(child, number);
}

/// A process stops behind its frame; what takes longer is not worth waiting for.
void LocalTasks::cancel() {
  waiting_.clear();
  signal(SIGTERM);
  const MonotonicInstant deadline = Monotonic::now() + kPatience;
  for (reap(); !running_.empty() && Monotonic::now() < deadline; reap()) pause();
  for (const pid_t child : running_) kill_process(child);
  running_.clear();
}

}  // namespace v3d::ctl
