// State of a camera in a running take, restored after a restart of the process.
#pragma once

#include <optional>
#include <vector>

#include "capture/sync/pulse_matcher.h"

namespace v3d {

struct CameraResumeState {
  std::vector<KnownFrame> frames;     ///< the last non-suspect frames; times of this host's clock
  std::optional<Duration> latency{};  ///< minimum time from a pulse to the arrival of its frame
  int64_t delivered = 0;              ///< frames of the take
  int64_t suspect = 0;                ///< suspect frames among these
};

}  // namespace v3d
