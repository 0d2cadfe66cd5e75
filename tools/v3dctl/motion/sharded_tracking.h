// Tracking of a take by several processes, on this PC or on a Slurm cluster.
#pragma once

#include <functional>
#include <memory>

#include "take/take.h"
#include "v3dctl/motion/take_motion.h"
#include "v3dctl/motion/track_folder.h"
#include "v3dctl/reconstruct/task_runner.h"

namespace v3d::ctl {

/// Called once.
using MakeTrackRunner = std::function<std::unique_ptr<TaskRunner>(const TaskFolder&)>;

/// track_take() by tasks, with the same bytes and segments as result. A task tracks the segment of
/// one range of pulses; what it leaves uncovered are further tasks. Segments of an earlier run with
/// the same request are kept, and those of this run after an error or interrupt. A segment that its
/// task did not finish is retried twice. TrackRequest::threads: of the survey of the pulses. Calls
/// and throws as track_take().
TrackReport track_sharded(const TrackRequest& request, const MakeTrackRunner& make_runner,
                          const std::function<void(int64_t pulses)>& on_begin,
                          const std::function<void()>& on_pulse);

/// Work of one task: tracks the segment of the pulses with the indices of `range`, unless it is
/// finished. Throws InputError for bad input, and std::runtime_error for errors of the disk and
/// after an interrupt.
void track_shard(const TrackFolder& folder, take::FrameRange range, int threads);

}  // namespace v3d::ctl
