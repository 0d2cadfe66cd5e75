#include <algorithm>
#include <ctime>
#include <sstream>
#include <stdexcept>
#include <vector>

#include "base/core/error.h"
#include "common/console.h"
#include "common/subprocess.h"
#include "v3dctl/options.h"
#include "v3dctl/process.h"
#include "v3dctl/reconstruct/task_runner.h"

namespace v3d::ctl {
namespace {

/// Largest number of tasks. Each task first repeats the segmentation of earlier pulses, so more
/// tasks cost more. Slurm's default limit of an array is 1,000.
constexpr int64_t kMaxTasks = 100;
constexpr auto kQueryPeriod = std::chrono::seconds(1);
constexpr auto kReportAfter = std::chrono::seconds(10);
/// Longer than Slurm's default time between SIGTERM and SIGKILL.
constexpr auto kSlurmCancelTimeout = std::chrono::seconds(40);

void pause_slurm() {
  const timespec period{0, 100'000'000};
  nanosleep(&period, nullptr);
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
    run_process({"scancel", "--me", "--name=" + name_}, Output::kCaptureBoth);
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
  const ProcessResult queue = run_process(
      {"squeue", "--me", "--noheader", "--array", "--format=%F %t %r"}, Output::kCaptureBoth);
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
  if (job_.empty()) return;
  query_queue();
  if (!job_.empty()) run_process({"scancel", job_}, Output::kCaptureBoth);
  const MonotonicInstant deadline = Monotonic::now() + kSlurmCancelTimeout;
  for (; !job_.empty() && Monotonic::now() < deadline; query_queue()) pause_slurm();
  if (!job_.empty()) note("slurm job " + job_ + " has not ended; see squeue");
  job_.clear();
}

std::string SlurmTaskRunner::hint() const {
  return ": check that the nodes can access " + folder_.path().parent_path().string() +
         " and v3dctl";
}

}  // namespace v3d::ctl
