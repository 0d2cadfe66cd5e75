#include "v3dctl/reconstruct/task_runner.h"

#include <fcntl.h>
#include <unistd.h>

#include <algorithm>
#include <csignal>
#include <ctime>
#include <filesystem>
#include <optional>
#include <sstream>
#include <stdexcept>
#include <vector>

#include "base/core/error.h"
#include "base/core/time.h"
#include "base/io/child_process.h"
#include "base/io/process.h"
#include "base/io/unique_fd.h"
#include "common/console.h"
#include "v3dctl/options.h"

namespace v3d::ctl {
namespace {

/// Number of tasks per process. More tasks balance the load better, but each task first repeats the
/// segmentation of earlier pulses.
constexpr int64_t kTasksPerProcess = 3;
constexpr auto kLocalCancelTimeout = std::chrono::seconds(5);
/// Status of a task that signal N ended is this plus N.
constexpr int kSignalStatus = 128;

void pause_local() {
  const timespec period{0, 50'000'000};
  nanosleep(&period, nullptr);  // the end of a child and Ctrl-C end it early
}

/// Starts a process without input whose output goes to `log`.
pid_t start_process(const std::vector<std::string>& words, const std::filesystem::path& log) {
  const io::UniqueFd output(io::uninterrupted(
      [&] { return ::open(log.c_str(), O_WRONLY | O_CREAT | O_APPEND | O_CLOEXEC, 0644); }));
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
  signal_ = 0;
  const auto tasks = kTasksPerProcess * static_cast<int64_t>(processes_);
  const int64_t max_length = (std::ssize(missing) + tasks - 1) / tasks;
  for (const int64_t index : missing) {
    const bool continues =
        !queue_.empty() && queue_.back().end == index && index - queue_.back().begin < max_length;
    if (!continues) queue_.push_back({index, index});
    queue_.back().end = index + 1;
  }
}

void LocalTaskRunner::start_task(take::FrameRange shards) {
  const std::string first = std::to_string(shards.begin);
  std::vector<std::string> words =
      task_words(folder_.path(), first + ":" + std::to_string(shards.end), threads_);
  words.insert(words.end(), {"--parent", std::to_string(getpid())});
  running_.push_back(start_process(words, folder_.path() / ("task-" + first + ".log")));
}

bool LocalTaskRunner::poll() {
  for (const int status : reap()) {
    if (status > kSignalStatus) signal_ = status - kSignalStatus;
  }
  for (; running_.size() < processes_ && !queue_.empty(); queue_.pop_front()) {
    start_task(queue_.front());
  }
  if (running_.empty()) return false;
  pause_local();
  return true;
}

std::vector<int> LocalTaskRunner::reap() {
  std::vector<int> statuses;
  std::erase_if(running_, [&](pid_t child) {
    const std::optional<int> status = poll_process(child);
    if (status) statuses.push_back(*status);
    return status.has_value();
  });
  return statuses;
}

std::string LocalTaskRunner::failure() const {
  if (signal_ == 0) return {};
  std::string text = "a task was ended by signal " + std::to_string(signal_);
  // Linux ends a process in this way when the memory is full.
  if (signal_ == SIGKILL) text += "; where memory is short, use fewer --processes";
  return text;
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

namespace {

/// Largest number of tasks. Each task first repeats the segmentation of earlier pulses, so more
/// tasks cost more. Slurm's default limit of an array is 1,000.
constexpr int64_t kMaxTasks = 100;
constexpr auto kQueryPeriod = std::chrono::seconds(1);
constexpr auto kReportAfter = std::chrono::seconds(10);
/// Longer than Slurm's default time between SIGTERM and SIGKILL.
constexpr auto kSlurmCancelTimeout = std::chrono::seconds(40);
/// Exit status, as that of a shell.
constexpr int kCannotStart = 127;

void pause_slurm() {
  const timespec period{0, 100'000'000};
  nanosleep(&period, nullptr);
}

/// Runs a Slurm command. One that cannot be started, such as at the process limit of the user, is
/// one that failed.
ProcessResult run_slurm(const std::vector<std::string>& words) {
  try {
    return run_process(words, Output::kCaptureBoth);
  } catch (const std::exception& error) {
    return {.status = kCannotStart, .output = {}, .errors = error.what()};
  }
}

/// Last line of the errors of a Slurm command, without the name of the command.
std::string error_text(const ProcessResult& result) {
  std::string text = result.errors;
  text.erase(text.find_last_not_of('\n') + 1);
  text.erase(0, text.rfind('\n') + 1);
  const size_t error = text.find("error: ");
  return error == std::string::npos ? text : text.substr(error + 7);
}

std::string quoted(const std::string& word) {
  std::string text = "'";
  for (const char c : word) text += c == '\'' ? std::string("'\\''") : std::string(1, c);
  return text + "'";
}

/// Increasing numbers as "0-3,7".
std::string ranges_of(const std::vector<int64_t>& numbers) {
  std::string text;
  for (size_t first = 0, last = 0; first < numbers.size(); first = ++last) {
    while (last + 1 < numbers.size() && numbers[last + 1] == numbers[last] + 1) ++last;
    text += (text.empty() ? "" : ",") + std::to_string(numbers[first]);
    if (last > first) text += "-" + std::to_string(numbers[last]);
  }
  return text;
}

/// Path of the task logs; Slurm replaces %a by the number of the task and %% by %.
std::string log_pattern(const std::string& folder) {
  std::string text;
  for (const char c : folder) text += c == '%' ? std::string("%%") : std::string(1, c);
  return text + "/task-%a.log";
}

/// Script of all tasks: the shell computes the range of shards from the number of the task.
std::string script(const std::string& folder, int64_t shards_per_task, int threads) {
  const std::string n = std::to_string(shards_per_task);
  const std::string range =
      "$((SLURM_ARRAY_TASK_ID * " + n + ")):$((SLURM_ARRAY_TASK_ID * " + n + " + " + n + "))";
  std::string text = "exec";
  for (const std::string& word : task_words(folder, range, threads)) {
    text += " " + (word == range ? word : quoted(word));
  }
  return text;
}

}  // namespace

SlurmTaskRunner::SlurmTaskRunner(ShardFolder folder, std::string partition, int threads,
                                 int64_t min_shards)
    : folder_(std::move(folder)),
      partition_(std::move(partition)),
      threads_(threads),
      min_shards_(min_shards),
      name_("v3d-" + folder_.path().parent_path().filename().string() + "-" + folder_.digest()) {}

SlurmTaskRunner::~SlurmTaskRunner() { cancel(); }

void SlurmTaskRunner::start(const std::vector<int64_t>& missing, int64_t count) {
  const int64_t shards = std::max(min_shards_, (count + kMaxTasks - 1) / kMaxTasks);
  std::vector<int64_t> tasks;
  for (const int64_t index : missing) {
    if (tasks.empty() || tasks.back() != index / shards) tasks.push_back(index / shards);
  }
  std::vector<std::string> words = {"sbatch",
                                    "--parsable",
                                    "--open-mode=append",
                                    "--job-name=" + name_,
                                    "--array=" + ranges_of(tasks),
                                    "--output=" + log_pattern(folder_.path()),
                                    "--cpus-per-task=" + std::to_string(threads_),
                                    "--wrap=" + script(folder_.path(), shards, threads_)};
  if (!partition_.empty()) words.push_back("--partition=" + partition_);
  // Cancel the job of a run that was killed.
  run_process({"scancel", "--me", "--name=" + name_}, Output::kCaptureBoth);
  const ProcessResult submitted = run_process(words, Output::kCaptureBoth);
  if (submitted.status != 0) {
    // Ctrl-C may have ended sbatch after it submitted the job.
    run_slurm({"scancel", "--me", "--name=" + name_});
    if (interrupted()) return;
    throw InputError("Slurm rejects the job: " + error_text(submitted));
  }
  job_ = submitted.output.substr(0, submitted.output.find_first_of(";\n"));
  next_query_ = idle_since_ = Monotonic::now();
  note("slurm job " + job_ + ": " + count_of(std::ssize(tasks), "task") + " of up to " +
       count_of(shards, "shard"));
}

bool SlurmTaskRunner::poll() {
  if (job_.empty()) return false;
  pause_slurm();
  if (Monotonic::now() < next_query_) return true;
  query_queue();
  report_waiting();
  next_query_ = Monotonic::now() + kQueryPeriod;
  return !job_.empty();
}

void SlurmTaskRunner::query_queue() {
  const ProcessResult queue =
      run_slurm({"squeue", "--me", "--noheader", "--array", "--format=%F %t %r"});
  if (queue.status != 0) {
    if (!query_failed_ && !interrupted()) note("squeue: " + error_text(queue) + "; trying again");
    query_failed_ = true;
    return;
  }
  query_failed_ = false;
  bool listed = false, running = false;
  std::istringstream lines(queue.output);
  std::string job, state, reason;
  while (lines >> job >> state && std::getline(lines >> std::ws, reason)) {
    if (job != job_) continue;
    listed = true;
    running |= state != "PD";
    reason_ = reason;
  }
  if (!listed) job_.clear();
  if (running) reason_.clear();
}

void SlurmTaskRunner::report_waiting() {
  if (reason_.empty()) idle_since_ = Monotonic::now();
  if (Monotonic::now() - idle_since_ < kReportAfter || !reported_.insert(reason_).second) return;
  note("slurm job " + job_ + " waits: " + reason_);
}

void SlurmTaskRunner::cancel() {
  const MonotonicInstant deadline = Monotonic::now() + kSlurmCancelTimeout;
  // Does not ask squeue first, because squeue may fail while the job runs.
  bool cancelled = false;
  for (; !job_.empty() && Monotonic::now() < deadline; query_queue()) {
    if (!cancelled) cancelled = run_slurm({"scancel", job_}).status == 0;
    pause_slurm();
  }
  if (!job_.empty()) note("slurm job " + job_ + " has not ended; see squeue");
  job_.clear();
}

std::string SlurmTaskRunner::hint() const {
  return ": check that the nodes can access " + folder_.path().parent_path().string() +
         " and v3dctl";
}

}  // namespace v3d::ctl
