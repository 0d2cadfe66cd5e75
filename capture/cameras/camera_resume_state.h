// What is known of a camera from before this process began, where a take goes on through it.
#pragma once

#include <optional>
#include <vector>

#include "capture/sync/pulse_matcher.h"

namespace v3d {

struct CameraResumeState {
  std::vector<KnownFrame> frames;     ///< the last ones without doubt, by this host's clock of now
  std::optional<Duration> latency{};  ///< the least from a pulse to the arrival of its frame
  int64_t delivered = 0;              ///< frames of the take
  int64_t suspect = 0;                ///< of these
};

}  // namespace v3d
