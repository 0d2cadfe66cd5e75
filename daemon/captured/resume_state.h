// Resume state of a take: clock, latency and recorded frames of each camera before the daemon
// restarted.
#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "capture/cameras/camera.h"
#include "take/ledger/ledger.h"
#include "take/logs/frame_log.h"
#include "take/take.h"

namespace v3d::captured {

/// Times of pulses by pulse number, by the realtime clock of this node when they were recorded. So
/// the clocks of other nodes do not matter, nor whether this clock was set since. Empty where the
/// time was unknown, or a version of before recorded the pulse.
using EdgeTimes = std::map<int64_t, std::optional<RealtimeInstant>>;

/// The pulses in the take's pulse log. Where the log cannot be read, there are none, and the cause
/// is added to `problems`.
EdgeTimes read_edge_times(const take::TakePaths& take, std::vector<std::string>& problems,
                          const take::ReadProgress& progress = {});

struct ResumeState {
  capture::CameraResumeState camera;
  take::CameraAccount account;  ///< of every frame in the log
  take::ExposureCount exposures;
  /// The log of these frames, so that it is not read again; empty where there is none that can be
  /// read.
  std::optional<take::FrameLogReader> log{};
  std::vector<std::string> problems{};  ///< why frames may be absent: path and cause
};

/// Reads the log of one camera, which takes minutes for a take of hours. A log that does not exist
/// gives a state without frames; so does a log that cannot be read, with the cause. Requires:
/// recover_take() has completed.
ResumeState read_resume_state(const take::TakePaths& take, const std::string& camera,
                              const EdgeTimes& edges, const take::ReadProgress& progress = {});

}  // namespace v3d::captured
