// The silhouettes of a take held against each other, and mended, before they are reconstructed.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "recon/reconstructor.h"
#include "recon/silhouette_mender.h"
#include "v3dctl/segmented_log.h"

namespace v3d::ctl {

struct PulseFault {
  int64_t pulse = 0;
  std::string camera;
  SilhouetteFault fault;
};

using SegmentedFrames = std::vector<std::optional<SegmentedFrame>>;

/// "missing piece", "phantom piece", "whole camera", "pulse late".
std::string name(SilhouetteFaultKind kind);

/// One caller at a time.
class MaskMending {
 public:
  /// Throws InputError as the reconstruction does.
  MaskMending(const Rig& rig, const ReconstructOptions& options);

  /// Replaces the masks of one pulse, one per camera of the rig, by mended ones, empty outside the
  /// view of the bounds; a camera that is better left out loses its frame, one that shows this
  /// pulse in its next frame gets that frame's picture. `next`: the frames of the next pulse, of
  /// which the masks are cut to the view of the bounds. Whether a camera is late is told where the
  /// pulse before was mended just before.
  void mend(int64_t pulse, SegmentedFrames& frames, SegmentedFrames& next);

  const std::vector<PulseFault>& faults() const { return faults_; }

 private:
  std::vector<const Mask*> cut(SegmentedFrames& frames) const;

  const Rig rig_;
  SilhouetteMender mender_;
  std::vector<Mask> views_;
  int64_t pulse_before_ = -2;
  std::vector<std::optional<Mask>> before_;  ///< mended, of that pulse
  std::vector<PulseFault> faults_;
};

/// "cam07: 12 missing pieces, 1 phantom piece, left out of 2 frames", for every camera with faults.
std::vector<std::string> lines_of(const std::vector<PulseFault>& faults);

}  // namespace v3d::ctl
