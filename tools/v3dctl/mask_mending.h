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

/// "missing piece", "phantom piece", "whole camera".
std::string name(SilhouetteFaultKind kind);

/// One caller at a time.
class MaskMending {
 public:
  /// Throws InputError as the reconstruction does.
  MaskMending(const Rig& rig, const ReconstructOptions& options);

  /// Replaces the masks of one pulse, one per camera of the rig, by mended ones, empty outside the
  /// view of the bounds; a camera that is better left out loses its frame.
  void mend(int64_t pulse, std::vector<std::optional<SegmentedFrame>>& frames);

  const std::vector<PulseFault>& faults() const { return faults_; }

 private:
  const Rig rig_;
  SilhouetteMender mender_;
  std::vector<Mask> views_;
  std::vector<PulseFault> faults_;
};

/// "cam07: 12 missing pieces, 1 phantom piece, left out of 2 frames", for every camera with faults.
std::vector<std::string> lines_of(const std::vector<PulseFault>& faults);

}  // namespace v3d::ctl
