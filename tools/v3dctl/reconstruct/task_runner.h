// Task runners of a sharded command: local processes, Slurm.
#pragma once

#include <sys/types.h>

#include <cstdint>
#include <deque>
#include <set>
#include <span>
#include <string>
#include <vector>

#include "base/core/time.h"
#include "take/take.h"
#include "v3dctl/reconstruct/task_folder.h"

namespace v3d::ctl {

/// Runs tasks; each task makes the unfinished shards of a range of indices. The destructor ends all
/// tasks. One thread.
class TaskRunner {
 public:
  virtual ~TaskRunner() = default;

  /// Starts tasks for the `missing` ones of `count` shards: indices, increasing and not empty.
  /// Requires that no task runs. Throws InputError if starting is impossible.
  virtual void start(const std::vector<int64_t>& missing, int64_t count) = 0;
  /// Starts a task for each of these ranges, also while other tasks run. Throws as start().
  virtual void start_each(const std::vector<take::FrameRange>& ranges) = 0;
  /// Waits about 0.1 s; returns whether tasks still run. Starts queued tasks.
  virtual bool poll() = 0;
  /// Ends all tasks and waits for their end.
  virtual void cancel() = 0;
  /// How a task of the last start() failed; empty if none failed or the reason is not available.
  virtual std::string failure() const = 0;
  /// Advice for a task that failed without a log.
  virtual std::string hint() const = 0;
};

/// Command line of one task: a hidden command of this program (add_task_command()). `range`: "A:B".
std::vector<std::string> task_words(const std::string& command, const std::string& folder,
                                    const std::string& range, int threads);

/// Runs tasks as processes of this PC. They end when this process ends.
class LocalTaskRunner : public TaskRunner {
 public:
  /// `command`: of each task. `processes`: number at a time. `threads`: of each.
  LocalTaskRunner(TaskFolder folder, std::string command, int processes, int threads);
  ~LocalTaskRunner() override;

  void start(const std::vector<int64_t>& missing, int64_t count) override;
  void start_each(const std::vector<take::FrameRange>& ranges) override;
  bool poll() override;
  void cancel() override;
  std::string failure() const override;
  std::string hint() const override { return {}; }

 private:
  void start_task(take::FrameRange shards);
  /// Forgets the tasks that have ended. Returns their statuses, as those of poll_process().
  std::vector<int> reap();
  void signal(int number) const;

  const TaskFolder folder_;
  const std::string command_;
  const size_t processes_;
  const int threads_;
  std::deque<take::FrameRange> queue_;  ///< indices of shards
  std::vector<pid_t> running_;
  int signal_ = 0;  ///< ended a task of the last start(); 0: none
};

/// Runs tasks as array jobs of a Slurm cluster. Uses Slurm's commands and needs no accounting:
/// squeue lists running tasks, the folder has the finished shards.
class SlurmTaskRunner : public TaskRunner {
 public:
  /// `command`: of each task. `partition`: empty for the default. `threads`: of each task.
  /// `min_shards`: of each task of start().
  SlurmTaskRunner(TaskFolder folder, std::string command, std::string partition, int threads,
                  int64_t min_shards);
  ~SlurmTaskRunner() override;

  void start(const std::vector<int64_t>& missing, int64_t count) override;
  void start_each(const std::vector<take::FrameRange>& ranges) override;
  bool poll() override;
  void cancel() override;
  std::string failure() const override { return {}; }  // it is in Slurm's accounting alone
  std::string hint() const override;

 private:
  /// Submits a job with a task for each range, which has up to `shards` shards.
  void submit(std::span<const take::FrameRange> ranges, int64_t shards);
  /// Cancels the jobs of a run that was killed.
  void cancel_by_name() const;
  /// Updates the state of the jobs from squeue; keeps it when squeue fails or does not start.
  void query_queue();
  void report_waiting();
  /// The numbers of the jobs, separated by commas.
  std::string jobs_text() const;

  const TaskFolder folder_;
  const std::string command_;
  const std::string partition_;
  const int threads_;
  const int64_t min_shards_;
  const std::string name_;         ///< of the jobs
  std::vector<std::string> jobs_;  ///< numbers of those that have not ended
  MonotonicInstant next_query_;
  MonotonicInstant idle_since_;     ///< no task has run since then
  std::string reason_;              ///< why tasks wait; empty when one runs
  std::set<std::string> reported_;  ///< reasons
  bool query_failed_ = false;       ///< and was reported
};

}  // namespace v3d::ctl
