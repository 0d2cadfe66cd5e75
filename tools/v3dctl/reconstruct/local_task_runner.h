// Tasks as processes of this PC.
#pragma once

#include <sys/types.h>

#include <deque>
#include <vector>

#include "v3dctl/reconstruct/shard_folder.h"
#include "v3dctl/reconstruct/task_runner.h"

namespace v3d::ctl {

class LocalTasks : public TaskRunner {
 public:
  /// So many at a time, each with so many threads. They end when this process does.
  LocalTasks(PieceFolder folder, int processes, int threads);
  ~LocalTasks() override;

  void start(const std::vector<int64_t>& missing, int64_t count) override;
  bool runs() override;
  void cancel() override;
  std::string hint() const override { return {}; }

 private:
  void begin(const Task& task);
  /// Forgets the processes that have ended.
  void reap();
  void signal(int number) const;

  const PieceFolder folder_;
  const size_t processes_;
  const int threads_;
  std::deque<Task> waiting_;
  std::vector<pid_t> running_;
};

}  // namespace v3d::ctl
