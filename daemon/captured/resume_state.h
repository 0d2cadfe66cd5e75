// What a node had recorded of one camera in a take, before it was started anew in it.
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

/// When pulses were, by the clock of the trigger's node.
using EdgeTimes = std::map<int64_t, RealtimeInstant>;

/// Those of the take's pulses that this node heard of.
EdgeTimes edge_times(const TakePaths& take);

struct ResumeState {
  CameraResumeState camera;
  CameraAccount account;  ///< of every frame in the log
  ExposureCount exposures;
};

/// A log that is not there is one without frames. Requires: recover_take() has been there.
ResumeState read_resume_state(const TakePaths& take, const std::string& camera,
                              const EdgeTimes& edges);

}  // namespace v3d
