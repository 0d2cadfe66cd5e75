// What a node had recorded of one camera in a take, before it was started anew in it.
#pragma once

#include <cstdint>
#include <map>
#include <string>
#include <vector>

#include "capture/camera_past.h"
#include "take/exposure_count.h"
#include "take/ledger.h"
#include "take/take.h"

namespace v3d {

/// When pulses were, by the clock of the trigger's node.
using EdgeTimes = std::map<int64_t, RealtimeInstant>;

/// Those of the take's pulses that this node heard of.
EdgeTimes edge_times(const TakePaths& take);

struct LanePast {
  CameraPast camera;
  CameraAccount account;  ///< of every frame in the log
  ExposureCount exposures;
};

/// A log that is not there is one without frames. Requires: recover_take() has been there.
LanePast read_lane_past(const TakePaths& take, const std::string& camera, const EdgeTimes& edges);

}  // namespace v3d
