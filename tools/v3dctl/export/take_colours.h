// What the cameras of a take saw of its reconstructed frames, camera by camera.
#pragma once

#include <cstdint>
#include <filesystem>
#include <vector>

#include "daemon/recorded/take_frames.h"
#include "recon/compact_frame.h"
#include "v3dctl/export/mesh_export.h"

namespace v3d::ctl {

/// One thread; works on several cameras at a time.
class TakeColours {
 public:
  /// Throws InputError: no take, a take without its raw frames, cameras whose attribute_name() is
  /// the same.
  explicit TakeColours(const std::filesystem::path& take);
  /// All cameras of the take, in the order of their names; one that has no frame of this pulse sees
  /// nothing. Throws InputError where none has. Fast in rising order of pulses.
  std::vector<ExportedCamera> of(const CompactFrame& frame);
  /// Frames until now that a camera of the take has not, or that cannot be read.
  int64_t incomplete() const { return incomplete_; }

 private:
  TakeFrames frames_;
  int64_t incomplete_ = 0;
};

}  // namespace v3d::ctl
