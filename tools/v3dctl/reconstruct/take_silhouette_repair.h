// Silhouette repair of a take: masks are corrected by those of the other cameras.
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "daemon/recorded/take_frames.h"
#include "recon/pipeline/frame_set_repair.h"
#include "recon/pipeline/reconstructor.h"
#include "recon/silhouettes/silhouette_repair.h"

namespace v3d::ctl {

struct PulseFault {
  int64_t pulse = 0;
  std::string camera;
  recon::SilhouetteFault fault;
};

/// Frames of one pulse, one for each camera of the rig; empty where a camera has none.
using SegmentedFrames = std::vector<std::optional<recorded::SegmentedFrame>>;

/// Repairs the masks of consecutive pulses. The result for a pulse depends on this pulse and its
/// two neighbours only, so shards of a take have the same result as the whole. One caller at a
/// time.
class TakeSilhouetteRepair {
 public:
  /// Throws InputError for options that the reconstruction rejects.
  TakeSilhouetteRepair(const Rig& rig, const recon::ReconstructOptions& options);

  /// Replaces the masks of `frames` by repaired ones, which are empty outside the view of the
  /// bounds. A camera with more wrong than right foreground loses its frame. A camera with a frame
  /// lag gets the raw frame in `next`, with its label; this is detected only if the last call was
  /// for `pulse` - 1. `next`: frames of the next pulse; their masks are limited to the view of the
  /// bounds.
  void repair(int64_t pulse, SegmentedFrames& frames, SegmentedFrames& next);

  /// Provides the pulse before the first call of repair(), without changing frames.
  void set_previous(int64_t pulse, SegmentedFrames frames);
  /// Whether the last call was for `pulse`.
  bool is_previous(int64_t pulse) const { return pulse == previous_pulse_; }

  const std::vector<PulseFault>& faults() const { return faults_; }

 private:
  std::vector<const Mask*> limit_to_view(SegmentedFrames& frames) const;
  recon::RepairedSilhouettes compare(const SegmentedFrames& frames,
                                     std::span<const Mask* const> masks,
                                     const recon::NeighbourMasks& neighbours);

  const Rig rig_;
  recon::SilhouetteRepair repair_;
  std::vector<Mask> views_;  ///< of the bounds, by camera
  int64_t previous_pulse_ = -2;
  std::vector<std::optional<Mask>> previous_;  ///< masks of that pulse, repaired without neighbours
  std::vector<PulseFault> faults_;
};

/// Repeats the silhouette repair of v3d-recond for given pulses, each by itself. One caller at a
/// time.
class LivePulseRepair {
 public:
  /// Requires ascending pulses. Throws InputError for options that the reconstruction rejects.
  LivePulseRepair(const Rig& rig, const recon::ReconstructOptions& options,
                  std::vector<int64_t> pulses);

  /// Repairs `set`, the observe_all() of `frames`, if its pulse is one of the given ones. `frames`
  /// gets the same masks, and loses the cameras that are left out.
  void repair(recon::FrameSet& set, SegmentedFrames& frames);

  const std::vector<PulseFault>& faults() const { return faults_; }

 private:
  const Rig rig_;
  recon::FrameSetRepair repair_;
  const std::vector<int64_t> pulses_;
  std::vector<PulseFault> faults_;
};

/// "cam07: 12 missing pieces, 1 phantom piece, left out of 2 frames", for each camera with faults.
std::vector<std::string> fault_lines(const std::vector<PulseFault>& faults);

}  // namespace v3d::ctl
