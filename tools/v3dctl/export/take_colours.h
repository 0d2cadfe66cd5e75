// Vertex colours of reconstructed frames in each camera, from the raw frames of the take.
#pragma once

#include <cstdint>
#include <filesystem>
#include <vector>

#include "daemon/recorded/take_frames.h"
#include "recon/pipeline/compact_frame.h"
#include "v3dctl/export/mesh_export.h"

namespace v3d::ctl {

/// One thread; uses several processors.
class TakeColours {
 public:
  /// Throws InputError for a folder that is no take, for a take without raw frames, and for cameras
  /// with equal attribute_name()s.
  explicit TakeColours(const std::filesystem::path& take);
  /// Colours of `frame` in all cameras of the take, ordered by name. In a camera without a frame of
  /// this pulse no vertex is visible. Throws InputError when no camera has one. Fast for increasing
  /// pulses.
  std::vector<ExportedCamera> of(const CompactFrame& frame);
  /// Number of frames so far in which a camera was missing or unreadable.
  int64_t incomplete() const { return incomplete_; }

 private:
  TakeFrames frames_;
  int64_t incomplete_ = 0;
};

}  // namespace v3d::ctl
