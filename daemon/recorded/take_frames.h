// The frames of a recorded take with their silhouettes, as the capture daemon would publish them.
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <unordered_map>
#include <vector>

#include "base/camera_model.h"
#include "daemon/recorded/segmented_log.h"
#include "recon/pipeline/reconstructor.h"
#include "take/take.h"

namespace v3d {

/// One thread; works on several cameras at a time.
class TakeFrames {
 public:
  /// Opens the logs of `cameras` (empty: all cameras of the take). Throws InputError: no take, an
  /// unknown camera, a camera without calibration or with one
  /// of another image size, a file that is no log, frames that have neither
  /// a stored mask nor a background model.
  TakeFrames(const std::filesystem::path& take, const std::vector<std::string>& cameras);

  const TakeInfo& info() const { return info_; }
  const TakePaths& paths() const { return paths_; }
  /// The calibration of the opened cameras, in the order of take.toml.
  const Rig& rig() const { return rig_; }
  /// The pulses of which at least one opened camera has a frame, rising.
  std::vector<int64_t> pulses() const;

  /// When the pulse was, by the take's pulses.lcmlog; 0 where it does not say.
  RealtimeInstant edge_of(int64_t pulse) const;

  /// SegmentedLog::read() by opened camera.
  std::vector<std::optional<SegmentedFrame>> read(int64_t pulse);

  /// What could not be read until now, some lines with path and cause.
  std::vector<std::string> read_errors() const;

 private:
  void read_edges();

  TakePaths paths_;
  TakeInfo info_;
  Rig rig_;
  std::vector<SegmentedLog> cameras_;
  std::unordered_map<int64_t, RealtimeInstant> edges_;
  std::string edges_error_;  ///< empty: pulses.lcmlog was read, or there is none
};

/// observe() of every frame there is; the masks are copied into the set.
FrameSet observe_all(int64_t pulse, const std::vector<std::optional<SegmentedFrame>>& frames);

}  // namespace v3d
