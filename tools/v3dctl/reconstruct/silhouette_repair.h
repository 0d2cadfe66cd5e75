// The silhouettes of a take held against each other, and mended, before they are reconstructed.
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "daemon/recorded/segmented_log.h"
#include "recon/reconstructor.h"
#include "recon/silhouette_mender.h"

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
  /// pulse before is known. That is held against nothing itself: what is made of a pulse depends on
  /// three pulses, in whatever parts a take is reconstructed.
  void mend(int64_t pulse, SegmentedFrames& frames, SegmentedFrames& next);

  /// The pulse that is known is the one looked at or mended last.
  bool knows(int64_t pulse) const { return pulse == known_pulse_; }
  void look_at(int64_t pulse, SegmentedFrames frames);

  const std::vector<PulseFault>& faults() const { return faults_; }

 private:
  std::vector<const Mask*> cut(SegmentedFrames& frames) const;
  MendedSilhouettes held_together(const SegmentedFrames& frames, std::span<const Mask* const> masks,
                                  const NeighbourMasks& neighbours);

  const Rig rig_;
  SilhouetteMender mender_;
  std::vector<Mask> views_;
  int64_t known_pulse_ = -2;
  std::vector<std::optional<Mask>> known_;  ///< of that pulse, mended by itself
  std::vector<PulseFault> faults_;
};

/// "cam07: 12 missing pieces, 1 phantom piece, left out of 2 frames", for every camera with faults.
std::vector<std::string> lines_of(const std::vector<PulseFault>& faults);

}  // namespace v3d::ctl
