// Tasks as an array job of a Slurm cluster.
#pragma once

#include <set>
#include <string>

#include "base/time.h"
#include "v3dctl/reconstruct/shard_folder.h"
#include "v3dctl/reconstruct/task_runner.h"

namespace v3d::ctl {

/// Needs Slurm's own commands alone, and no accounting: squeue says what runs, the pieces on the
/// disk what was done.
class SlurmTasks : public TaskRunner {
 public:
  /// `partition`: empty for the cluster's default one. Every task gets so many threads, and makes
  /// at least `pieces` pieces.
  SlurmTasks(PieceFolder folder, std::string partition, int threads, int64_t pieces);
  ~SlurmTasks() override;

  void start(const std::vector<int64_t>& missing, int64_t count) override;
  bool runs() override;
  void cancel() override;
  std::string hint() const override;

 private:
  /// Reads the queue; what cannot be read leaves all as it was.
  void look();
  void say_why_it_waits();

  const PieceFolder folder_;
  const std::string partition_;
  const int threads_;
  const int64_t least_pieces_;
  const std::string name_;  ///< of the jobs
  std::string job_;         ///< empty: none
  MonotonicInstant next_look_;
  MonotonicInstant idle_since_;  ///< no task runs since then
  std::string reason_;           ///< why tasks wait; empty when one runs
  std::set<std::string> said_;   ///< reasons that were told
  bool silent_ = false;          ///< the queue could not be read
};

}  // namespace v3d::ctl
