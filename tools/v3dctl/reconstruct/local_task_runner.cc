#include <fcntl.h>
#include <unistd.h>

#include <algorithm>
#include <csignal>
#include <ctime>
#include <filesystem>
#include <stdexcept>

#include "base/core/error.h"
#include "base/core/time.h"
#include "base/io/process.h"
#include "base/io/uninterrupted.h"
#include "base/io/unique_fd.h"
#include "v3dctl/reconstruct/task_runner.h"

namespace v3d::ctl {
namespace {

/// Number of tasks per process. More tasks balance the load better, but each task first repeats the
/// segmentation of earlier pulses.
constexpr int64_t kTasksPerProcess = 3;
constexpr auto kLocalCancelTimeout = std::chrono::seconds(5);

void pause_local() {
  const timespec period{0, 50'000'000};
  nanosleep(&period, nullptr);  // the end of a child and Ctrl-C end it early
}

/// Starts a process without input whose output goes to `log`.
pid_t start_process(const std::vector<std::string>& words, const std::filesystem::path& log) {
  const io::UniqueFd output(io::uninterrupted(
      [&] { return open(log.c_str(), O_WRONLY | O_CREAT | O_APPEND | O_CLOEXEC, 0644); }));
  if (!output) throw std::runtime_error(errno_message(log.string()));
  const pid_t child = spawn_process(words, {.output = output.get(), .errors = output.get()});
  if (child < 0) throw std::runtime_error(errno_message("cannot run " + words.front()));
  return child;
}

}  // namespace

std::vector<std::string> task_words(const std::string& folder, const std::string& range,
                                    int threads) {
  const std::string program = std::filesystem::read_symlink("/proc/self/exe");
  return {program, "reconstruct-shards", folder, range, "--threads", std::to_string(threads)};
}

LocalTaskRunner::LocalTaskRunner(ShardFolder folder, int processes, int threads)
    : folder_(std::move(folder)), processes_(static_cast<size_t>(processes)), threads_(threads) {}

LocalTaskRunner::~LocalTaskRunner() { cancel(); }

void LocalTaskRunner::start(const std::vector<int64_t>& missing, int64_t) {
  const auto tasks = kTasksPerProcess * static_cast<int64_t>(processes_);
  const int64_t max_length = (std::ssize(missing) + tasks - 1) / tasks;
  for (const int64_t index : missing) {
    const bool continues =
        !queue_.empty() && queue_.back().end == index && index - queue_.back().begin < max_length;
    if (!continues) queue_.push_back({index, index});
    queue_.back().end = index + 1;
  }
}

void LocalTaskRunner::start_task(FrameRange shards) {
  const std::string first = std::to_string(shards.begin);
  std::vector<std::string> words =
      task_words(folder_.path(), first + ":" + std::to_string(shards.end), threads_);
  words.insert(words.end(), {"--parent", std::to_string(getpid())});
  running_.push_back(start_process(words, folder_.path() / ("task-" + first + ".log")));
}

bool LocalTaskRunner::poll() {
  reap();
  for (; running_.size() < processes_ && !queue_.empty(); queue_.pop_front()) {
    start_task(queue_.front());
  }
  if (running_.empty()) return false;
  pause_local();
  return true;
}

void LocalTaskRunner::reap() {
  std::erase_if(running_, [](pid_t child) { return poll_process(child).has_value(); });
}

void LocalTaskRunner::signal(int number) const {
  for (const pid_t child : running_) kill(child, number);
}

/// A process stops after its current frame; one that takes longer is killed.
void LocalTaskRunner::cancel() {
  queue_.clear();
  signal(SIGTERM);
  const MonotonicInstant deadline = Monotonic::now() + kLocalCancelTimeout;
  for (reap(); !running_.empty() && Monotonic::now() < deadline; reap()) pause_local();
  for (const pid_t child : running_) kill_process(child);
  running_.clear();
}

}  // namespace v3d::ctl
