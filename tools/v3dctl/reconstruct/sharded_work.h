// Work that several processes share: starts tasks until all shards are finished.
#pragma once

#include <cstdint>
#include <map>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "take/take.h"
#include "v3dctl/reconstruct/task_folder.h"
#include "v3dctl/reconstruct/task_runner.h"

namespace v3d::ctl {

/// The shards of a command. A shard is a range of indices; ranges do not overlap at one time. One
/// thread.
class ShardedWork {
 public:
  virtual ~ShardedWork() = default;

  /// Reads the shards that have been finished; damaged ones stay missing.
  virtual void find_finished() = 0;
  /// The known shards that are not finished, ascending. Finished shards may make others known.
  virtual std::vector<take::FrameRange> missing() const = 0;
  /// Starts a task for each of these shards. Before, it deletes their damaged files, which would
  /// otherwise count as finished.
  virtual void start(const std::vector<take::FrameRange>& shards, TaskRunner& tasks) = 0;
  /// Called while tasks run: shows the progress. Returns false when all shards are finished
  /// according to the names of the files.
  virtual bool watch() = 0;
  /// The shards of missing() to start while tasks run. Those that have a task are not started
  /// again.
  virtual std::vector<take::FrameRange> known_meanwhile() const { return {}; }
};

/// One run of a sharded command in a folder. One thread.
class ShardedRun {
 public:
  /// `command`: for messages. All arguments but it are borrowed. Throws InputError when another
  /// process makes the shards of the folder, and std::runtime_error when its lock cannot be opened.
  /// Accepts a disk without locks: two runs in one folder would then do the same work twice.
  ShardedRun(const TaskFolder& folder, TaskRunner& tasks, const std::string& command);

  /// Makes all shards. Those that their task did not finish are retried twice. Shards of an earlier
  /// run are kept, and those of this run after an error. Throws InputError for an error of a task
  /// that no retry can resolve; std::runtime_error when a shard has failed three times, and after
  /// an interrupt. Without finished shards the folder is then removed, unless the message names a
  /// log in it.
  void make(ShardedWork& work);

 private:
  using Key = std::pair<int64_t, int64_t>;

  void make_missing(ShardedWork& work);
  void run_tasks(ShardedWork& work);
  void start(const std::vector<take::FrameRange>& shards, ShardedWork& work);
  void stop_on_error_or_interrupt();
  void stop_after_too_many_tries(const std::vector<take::FrameRange>& missing);
  std::string reason_of_failure();

  const TaskFolder& folder_;
  TaskRunner& tasks_;
  const ShardFolderLock lock_;
  std::map<Key, int> tries_;  ///< by shard
  std::set<Key> started_;     ///< since no task ran
  bool names_log_ = false;    ///< the error does, so the log stays
};

}  // namespace v3d::ctl
