// A take to mesh.v3d by several processes, on this PC or on those of a Slurm cluster.
#pragma once

#include <functional>
#include <memory>

#include "v3dctl/reconstruct/reconstruct_report.h"
#include "v3dctl/reconstruct/reconstruct_request.h"
#include "v3dctl/reconstruct/shard_folder.h"
#include "v3dctl/reconstruct/task_runner.h"

namespace v3d::ctl {

/// reconstruct_take(), with the same bytes as its result. The take is cut into pieces; those that
/// an earlier run of the same request finished are kept, and those of this run when it fails or is
/// interrupted. A task that ends without its pieces is tried again, twice. `make_tasks` is asked
/// once.
using MakeTasks = std::function<std::unique_ptr<TaskRunner>(const PieceFolder&,
                                                            const ReconstructRequest& settled)>;
ReconstructReport reconstruct_shared(const ReconstructRequest& request, int threads,
                                     const MakeTasks& make_tasks);

/// The pieces of `range` that are missing in the folder: what a task does.
void reconstruct_pieces(const PieceFolder& folder, FrameRange range, int threads);

}  // namespace v3d::ctl
