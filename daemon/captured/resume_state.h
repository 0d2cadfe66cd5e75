// Resume state of a take: clock, latency and recorded frames of each camera before the daemon
// restarted.
#pragma once

#include <cstdint>
#include <map>
#include <string>
#include <vector>

#include "capture/cameras/camera_resume_state.h"
#include "take/ledger/exposure_count.h"
#include "take/ledger/ledger.h"
#include "take/take.h"

namespace v3d {

/// Times of pulses by pulse number, by the realtime clock of the trigger's node.
using EdgeTimes = std::map<int64_t, RealtimeInstant>;

/// The pulses in the take's pulse log. Empty, with an error in the daemon's log, when the log
/// cannot be read.
EdgeTimes read_edge_times(const TakePaths& take);

struct ResumeState {
  CameraResumeState camera;
  CameraAccount account;  ///< of every frame in the log
  ExposureCount exposures;
};

/// Reads the log of one camera. A log that does not exist or cannot be read gives a state without
/// frames. Requires: recover_take() has completed.
ResumeState read_resume_state(const TakePaths& take, const std::string& camera,
                              const EdgeTimes& edges);

}  // namespace v3d
