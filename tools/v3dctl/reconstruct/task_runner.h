// Task runners of a sharded reconstruction: local processes, Slurm.
#pragma once

#include <sys/types.h>

#include <cstdint>
#include <deque>
#include <functional>
#include <memory>
#include <set>
#include <string>
#include <vector>

#include "base/core/time.h"
#include "take/take.h"
#include "v3dctl/reconstruct/shard_folder.h"

namespace v3d::ctl {

// Task runners: where the tasks of a sharded reconstruction run.

/// Runs tasks; each task makes the unfinished shards of a range of indices. The destructor ends all
/// tasks. One thread.
class TaskRunner {
 public:
  virtual ~TaskRunner() = default;

  /// Starts tasks for the `missing` ones of `count` shards: indices, increasing and not empty.
  /// Requires that no task runs. Throws InputError if starting is impossible.
  virtual void start(const std::vector<int64_t>& missing, int64_t count) = 0;
  /// Waits about 0.1 s; returns whether tasks still run. Starts queued tasks.
  virtual bool poll() = 0;
  /// Ends all tasks and waits for their end.
  virtual void cancel() = 0;
  /// How a task of the last start() failed; empty if none failed or the reason is not available.
  virtual std::string failure() const = 0;
  /// Advice for a task that failed without a log.
  virtual std::string hint() const = 0;
};

/// Command line of one task: the hidden command reconstruct-shards of this program. `range`: "A:B".
std::vector<std::string> task_words(const std::string& folder, const std::string& range,
                                    int threads);

/// Runs tasks as processes of this PC. They end when this process ends.
class LocalTaskRunner : public TaskRunner {
 public:
  /// `processes`: number at a time. `threads`: of each.
  LocalTaskRunner(ShardFolder folder, int processes, int threads);
  ~LocalTaskRunner() override;

  void start(const std::vector<int64_t>& missing, int64_t count) override;
  bool poll() override;
  void cancel() override;
  std::string failure() const override;
  std::string hint() const override { return {}; }

 private:
  void start_task(take::FrameRange shards);
  /// Forgets the tasks that have ended. Returns their statuses, as those of poll_process().
  std::vector<int> reap();
  void signal(int number) const;

  const ShardFolder folder_;
  const size_t processes_;
  const int threads_;
  std::deque<take::FrameRange> queue_;  ///< indices of shards
  std::vector<pid_t> running_;
  int signal_ = 0;  ///< ended a task of the last start(); 0: none
};

/// Runs tasks as an array job of a Slurm cluster. Uses Slurm's commands and needs no accounting:
/// squeue lists running tasks, the folder has the finished shards.
class SlurmTaskRunner : public TaskRunner {
 public:
  /// `partition`: empty for the default. `threads`: of each task. `min_shards`: of each task.
  SlurmTaskRunner(ShardFolder folder, std::string partition, int threads, int64_t min_shards);
  ~SlurmTaskRunner() override;

  void start(const std::vector<int64_t>& missing, int64_t count) override;
  bool poll() override;
  void cancel() override;
  std::string failure() const override { return {}; }  // it is in Slurm's accounting alone
  std::string hint() const override;

 private:
  /// Updates the state of the job from squeue; keeps it when squeue fails or does not start.
  void query_queue();
  void report_waiting();

  const ShardFolder folder_;
  const std::string partition_;
  const int threads_;
  const int64_t min_shards_;
  const std::string name_;  ///< of the jobs
  std::string job_;         ///< number; empty: none
  MonotonicInstant next_query_;
  MonotonicInstant idle_since_;     ///< no task has run since then
  std::string reason_;              ///< why tasks wait; empty when one runs
  std::set<std::string> reported_;  ///< reasons
  bool query_failed_ = false;       ///< and was reported
};

// Reconstruction of a take by several processes, on this PC or on a Slurm cluster.

/// Called once, with the complete request.
using MakeTaskRunner = std::function<std::unique_ptr<TaskRunner>(
    const ShardFolder&, const ReconstructRequest& complete)>;

/// reconstruct_take() by tasks, with the same bytes as result. Shards of an earlier run with the
/// same request are kept, and those of this run after an error or interrupt. Shards that their task
/// did not finish are retried twice. `threads`: of all tasks, for the report. Throws as
/// reconstruct_take().
ReconstructReport reconstruct_sharded(const ReconstructRequest& request, int threads,
                                      const MakeTaskRunner& make_runner);

/// Work of one task: makes the unfinished shards of `range`, given by their indices in the take.
void reconstruct_shards(const ShardFolder& folder, take::FrameRange range, int threads);

}  // namespace v3d::ctl
