// Reader of the frames of all cameras of a recorded take, with the silhouettes that the capture
// daemon would have published.
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <unordered_map>
#include <vector>

#include "base/geometry/camera_model.h"
#include "daemon/recorded/segmented_log.h"
#include "recon/pipeline/frame_set.h"
#include "take/take.h"

namespace v3d {

/// One caller at a time; works on several cameras in parallel.
class TakeFrames {
 public:
  /// Opens the logs of `cameras` (empty: all cameras of the take). Throws InputError if `take` is
  /// not a take, a camera is unknown, has no calibration or one of another image size, or a file is
  /// not a log.
  TakeFrames(const std::filesystem::path& take, const std::vector<std::string>& cameras);

  const TakeInfo& info() const { return info_; }
  const TakePaths& paths() const { return paths_; }
  /// The calibration of the opened cameras, in the order of take.toml.
  const Rig& rig() const { return rig_; }
  /// The pulses of which at least one opened camera has a frame, ascending.
  std::vector<int64_t> pulses() const;

  /// The time of the pulse in pulses.lcmlog of the take; 0 if unknown.
  RealtimeInstant edge_of(int64_t pulse) const;

  /// SegmentedLog::read() for each opened camera.
  std::vector<std::optional<SegmentedFrame>> read(int64_t pulse);

  /// Read errors so far: lines with path and cause.
  std::vector<std::string> read_errors() const;

 private:
  void read_edges();

  TakePaths paths_;
  TakeInfo info_;
  Rig rig_;
  std::vector<SegmentedLog> cameras_;
  std::unordered_map<int64_t, RealtimeInstant> edges_;
  std::string edges_error_;  ///< empty: pulses.lcmlog was read, or is absent
};

/// The frame set of all present frames, by observe(). Copies the masks.
FrameSet observe_all(int64_t pulse, const std::vector<std::optional<SegmentedFrame>>& frames);

}  // namespace v3d
