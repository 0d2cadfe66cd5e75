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

std::vector<std::string> task_words(const std::string& command, const std::string& folder,
                                    const std::string& range, int threads) {
  const std::string program = std::filesystem::read_symlink("/proc/self/exe");
  return {program, command, folder, range, "--threads", std::to_string(threads)};
}

LocalTaskRunner::LocalTaskRunner(TaskFolder folder, std::string command, int processes, int threads)
    : folder_(std::move(folder)),
      command_(std::move(command)),
      processes_(static_cast<size_t>(processes)),
      threads_(threads) {}

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

void LocalTaskRunner::start_each(const std::vector<take::FrameRange>& ranges) {
  if (running_.empty() && queue_.empty()) signal_ = 0;
  queue_.insert(queue_.end(), ranges.begin(), ranges.end());
}

void LocalTaskRunner::start_task(take::FrameRange shards) {
  const std::string first = std::to_string(shards.begin);
  std::vector<std::string> words =
      task_words(command_, folder_.path(), first + ":" + std::to_string(shards.end), threads_);
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

/// Largest number of tasks of start(). Each task first repeats the segmentation of earlier pulses,
/// so more tasks cost more.
constexpr int64_t kMaxTasks = 100;
/// Largest number of tasks of one job: Slurm's default limit of an array.
constexpr size_t kMaxArray = 1000;
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

/// Path of the task logs; Slurm replaces %a by the number of the task and %% by %.
std::string log_pattern(const std::string& folder) {
  std::string text;
  for (const char c : folder) text += c == '%' ? std::string("%%") : std::string(1, c);
  return text + "/task-%a.log";
}

/// Script of all tasks: the shell takes the range from the list by the number of the task.
std::string script(const std::string& command, const std::string& folder,
                   std::span<const take::FrameRange> ranges, int threads) {
  const std::string range = "\"$1\"";
  std::string text = "set --";
  for (const take::FrameRange& shards : ranges) {
    text += " " + std::to_string(shards.begin) + ":" + std::to_string(shards.end);
  }
  text += "; shift $SLURM_ARRAY_TASK_ID; exec";
  for (const std::string& word : task_words(command, folder, range, threads)) {
    text += " " + (word == range ? word : quoted(word));
  }
  return text;
}

}  // namespace

SlurmTaskRunner::SlurmTaskRunner(TaskFolder folder, std::string command, std::string partition,
                                 int threads, int64_t min_shards)
    : folder_(std::move(folder)),
      command_(std::move(command)),
      partition_(std::move(partition)),
      threads_(threads),
      min_shards_(min_shards),
      name_("v3d-" + folder_.path().parent_path().filename().string() + "-" + folder_.digest()) {}

SlurmTaskRunner::~SlurmTaskRunner() { cancel(); }

void SlurmTaskRunner::start(const std::vector<int64_t>& missing, int64_t count) {
  const int64_t shards = std::max(min_shards_, (count + kMaxTasks - 1) / kMaxTasks);
  std::vector<take::FrameRange> ranges;
  for (const int64_t index : missing) {
    const int64_t first = index / shards * shards;
    if (ranges.empty() || ranges.back().begin != first) ranges.push_back({first, first + shards});
  }
  cancel_by_name();
  submit(ranges, shards);
}

void SlurmTaskRunner::start_each(const std::vector<take::FrameRange>& ranges) {
  if (jobs_.empty()) cancel_by_name();
  for (size_t first = 0; first < ranges.size(); first += kMaxArray) {
    submit(std::span(ranges).subspan(first, std::min(kMaxArray, ranges.size() - first)), 1);
  }
}

void SlurmTaskRunner::cancel_by_name() const {
  run_process({"scancel", "--me", "--name=" + name_}, Output::kCaptureBoth);
}

void SlurmTaskRunner::submit(std::span<const take::FrameRange> ranges, int64_t shards) {
  std::vector<std::string> words = {"sbatch",
                                    "--parsable",
                                    "--open-mode=append",
                                    "--job-name=" + name_,
                                    "--array=0-" + std::to_string(ranges.size() - 1),
                                    "--output=" + log_pattern(folder_.path()),
                                    "--cpus-per-task=" + std::to_string(threads_),
                                    "--wrap=" + script(command_, folder_.path(), ranges, threads_)};
  if (!partition_.empty()) words.push_back("--partition=" + partition_);
  const ProcessResult submitted = run_process(words, Output::kCaptureBoth);
  if (submitted.status != 0) {
    // Ctrl-C may have ended sbatch after it submitted the job.
    run_slurm({"scancel", "--me", "--name=" + name_});
    if (interrupted()) return;
    throw InputError("Slurm rejects the job: " + error_text(submitted));
  }
  const std::string& job =
      jobs_.emplace_back(submitted.output.substr(0, submitted.output.find_first_of(";\n")));
  next_query_ = idle_since_ = Monotonic::now();
  note("slurm job " + job + ": " + count_of(std::ssize(ranges), "task") + " of up to " +
       count_of(shards, "shard"));
}

bool SlurmTaskRunner::poll() {
  if (jobs_.empty()) return false;
  pause_slurm();
  if (Monotonic::now() < next_query_) return true;
  query_queue();
  report_waiting();
  next_query_ = Monotonic::now() + kQueryPeriod;
  return !jobs_.empty();
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
  bool running = false;
  std::set<std::string> listed;
  std::istringstream lines(queue.output);
  std::string job, state, reason;
  while (lines >> job >> state && std::getline(lines >> std::ws, reason)) {
    if (std::ranges::find(jobs_, job) == jobs_.end()) continue;
    listed.insert(job);
    running |= state != "PD";
    reason_ = reason;
  }
  std::erase_if(jobs_, [&](const std::string& number) { return !listed.contains(number); });
  if (running) reason_.clear();
}

void SlurmTaskRunner::report_waiting() {
  if (reason_.empty()) idle_since_ = Monotonic::now();
  if (Monotonic::now() - idle_since_ < kReportAfter || !reported_.insert(reason_).second) return;
  note("slurm job " + jobs_text() + " waits: " + reason_);
}

std::string SlurmTaskRunner::jobs_text() const {
  std::string text;
  for (const std::string& job : jobs_) text += (text.empty() ? "" : ",") + job;
  return text;
}

void SlurmTaskRunner::cancel() {
  const MonotonicInstant deadline = Monotonic::now() + kSlurmCancelTimeout;
  // Does not ask squeue first, because squeue may fail while the jobs run.
  std::set<std::string> cancelled;
  for (; !jobs_.empty() && Monotonic::now() < deadline; query_queue()) {
    for (const std::string& job : jobs_) {
      if (cancelled.contains(job) || run_slurm({"scancel", job}).status != 0) continue;
      cancelled.insert(job);
    }
    pause_slurm();
  }
  if (!jobs_.empty()) note("slurm job " + jobs_text() + " has not ended; see squeue");
  jobs_.clear();
}

std::string SlurmTaskRunner::hint() const {
  return ": check that the nodes can access " + folder_.path().parent_path().string() +
         " and v3dctl";
}

}  // namespace v3d::ctl
