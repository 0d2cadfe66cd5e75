// Reconstruction of a take by several processes, on this PC or on a Slurm cluster.
#pragma once

#include <functional>
#include <memory>

#include "take/take.h"
#include "v3dctl/reconstruct/reconstruct_report.h"
#include "v3dctl/reconstruct/reconstruct_request.h"
#include "v3dctl/reconstruct/shard_folder.h"
#include "v3dctl/reconstruct/task_runner.h"

namespace v3d::ctl {

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
