#include "v3dctl/reconstruct/slurm_task_runner.h"

#include <algorithm>
#include <ctime>
#include <sstream>
#include <stdexcept>
#include <vector>

#include "base/error.h"
#include "common/console.h"
#include "common/subprocess.h"
#include "v3dctl/options.h"
#include "v3dctl/process.h"

namespace v3d::ctl {
namespace {

/// Every task begins by learning what the segmentation had learnt until there; and Slurm's arrays
/// have 1,000 places unless it is told otherwise.
constexpr int64_t kMostTasks = 100;
constexpr auto kBetweenLooks = std::chrono::seconds(1);
constexpr auto kWorthTelling = std::chrono::seconds(10);
/// Longer than Slurm waits, unless it is told otherwise, before it kills what it has asked to end.
constexpr auto kPatience = std::chrono::seconds(40);

void pause() {
  const timespec look_again{0, 100'000'000};
  nanosleep(&look_again, nullptr);
}

/// What a command of Slurm's said last, without its name before it.
std::string complaint(const ProcessResult& result) {
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

/// Rising numbers as "0-3,7".
std::string ranges_of(const std::vector<int64_t>& numbers) {
  std::string text;
  for (size_t first = 0, last = 0; first < numbers.size(); first = ++last) {
    while (last + 1 < numbers.size() && numbers[last + 1] == numbers[last] + 1) ++last;
    text += (text.empty() ? "" : ",") + std::to_string(numbers[first]);
    if (last > first) text += "-" + std::to_string(numbers[last]);
  }
  return text;
}

/// The task's log, in which Slurm puts its number; other percent signs are the folder's own.
std::string log_pattern(const std::string& folder) {
  std::string text;
  for (const char c : folder) text += c == '%' ? std::string("%%") : std::string(1, c);
  return text + "/task-%a.log";
}

/// The shell on the node reckons its pieces from its number in the array.
std::string script(const std::string& folder, int64_t pieces, int threads) {
  const std::string n = std::to_string(pieces);
  const std::string range =
      "$((SLURM_ARRAY_TASK_ID * " + n + ")):$((SLURM_ARRAY_TASK_ID * " + n + " + " + n + "))";
  std::string text = "exec";
  for (const std::string& word : task_words(folder, range, threads)) {
    text += " " + (word == range ? word : quoted(word));
  }
  return text;
}

}  // namespace

SlurmTasks::SlurmTasks(PieceFolder folder, std::string partition, int threads, int64_t pieces)
    : folder_(std::move(folder)),
      partition_(std::move(partition)),
      threads_(threads),
      least_pieces_(pieces),
      name_("v3d-" + folder_.path().parent_path().filename().string() + "-" + folder_.digest()) {}

SlurmTasks::~SlurmTasks() { cancel(); }

void SlurmTasks::start(const std::vector<int64_t>& missing, int64_t count) {
  const int64_t pieces = std::max(least_pieces_, (count + kMostTasks - 1) / kMostTasks);
  std::vector<int64_t> tasks;
  for (const int64_t place : missing) {
    if (tasks.empty() || tasks.back() != place / pieces) tasks.push_back(place / pieces);
  }
  std::vector<std::string> words = {"sbatch",
                                    "--parsable",
                                    "--open-mode=append",
                                    "--job-name=" + name_,
                                    "--array=" + ranges_of(tasks),
                                    "--output=" + log_pattern(folder_.path()),
                                    "--cpus-per-task=" + std::to_string(threads_),
                                    "--wrap=" + script(folder_.path(), pieces, threads_)};
  if (!partition_.empty()) words.push_back("--partition=" + partition_);
  // Of a run that was killed.
  run_process({"scancel", "--me", "--name=" + name_}, Output::kCaptureBoth);
  const ProcessResult submitted = run_process(words, Output::kCaptureBoth);
  if (submitted.status != 0) {
    // Ctrl-C may have ended it behind its work.
    run_process({"scancel", "--me", "--name=" + name_}, Output::kCaptureBoth);
    if (interrupted()) return;
    throw InputError("Slurm refuses the job: " + complaint(submitted));
  }
  job_ = submitted.output.substr(0, submitted.output.find_first_of(";\n"));
  next_look_ = idle_since_ = Monotonic::now();
  note("slurm job " + job_ + ": " + count_of(std::ssize(tasks), "task") + " of up to " +
       count_of(pieces, "piece"));
}

bool SlurmTasks::runs() {
  if (job_.empty()) return false;
  pause();
  if (Monotonic::now() < next_look_) return true;
  look();
  say_why_it_waits();
  next_look_ = Monotonic::now() + kBetweenLooks;
  return !job_.empty();
}

void SlurmTasks::look() {
  const ProcessResult queue = run_process(
      {"squeue", "--me", "--noheader", "--array", "--format=%F %t %r"}, Output::kCaptureBoth);
  if (queue.status != 0) {
    if (!silent_ && !interrupted()) note("squeue: " + complaint(queue) + "; waiting for it");
    silent_ = true;
    return;
  }
  silent_ = false;
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

void SlurmTasks::say_why_it_waits() {
  if (reason_.empty()) idle_since_ = Monotonic::now();
  if (Monotonic::now() - idle_since_ < kWorthTelling || !said_.insert(reason_).second) return;
  note("slurm job " + job_ + " waits: " + reason_);
}

void SlurmTasks::cancel() {
  if (job_.empty()) return;
  look();
  if (!job_.empty()) run_process({"scancel", job_}, Output::kCaptureBoth);
  const MonotonicInstant deadline = Monotonic::now() + kPatience;
  for (; !job_.empty() && Monotonic::now() < deadline; look()) pause();
  if (!job_.empty()) note("slurm job " + job_ + " has not ended yet: see squeue");
  job_.clear();
}

std::string SlurmTasks::hint() const {
  return ": do the nodes see " + folder_.path().parent_path().string() + " and v3dctl?";
}

}  // namespace v3d::ctl
