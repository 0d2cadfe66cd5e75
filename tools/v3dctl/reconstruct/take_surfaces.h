// Surfaces of a take, pulse by pulse, with temporal smoothing.
#pragma once

#include <cstdint>
#include <map>
#include <vector>

#include "daemon/recorded/take_frames.h"
#include "recon/pipeline/reconstructor.h"
#include "v3dctl/reconstruct/silhouette_repair.h"

namespace v3d::ctl {

/// Surface of one pulse; its vertices have no colours yet.
struct TakeSurface {
  SegmentedFrames frames;
  double segment_ms = 0;
  FrameSetJob work;
};

/// A smoothed surface depends on the surfaces one pulse before and after, and these on the views
/// one pulse farther: a window of two pulses to each side, of three with silhouette repair. It
/// depends on nothing else, so order and shards do not change it. One caller at a time, in its TBB
/// arena.
class TakeSurfaces {
 public:
  /// All references are borrowed. `repair`: null for none. Without `smooth`, each pulse is
  /// reconstructed alone.
  TakeSurfaces(TakeFrames& take, Reconstructor& reconstructor, TakeSilhouetteRepair* repair,
               bool smooth);

  /// Requires increasing pulses that the take has. Throws as TakeFrames::read().
  TakeSurface make(int64_t pulse);

 private:
  struct WindowEntry {
    TakeSurface surface;  ///< a hull until `deformed`; moved away by make()
    PulseViews views;
    bool deformed = false;
  };
  bool has(int64_t pulse) const;
  TakeSurface read(int64_t pulse);
  void set_previous_of(int64_t pulse);
  void repair(int64_t pulse, SegmentedFrames& frames);
  void make_hull(int64_t pulse);
  void deform(int64_t pulse);
  std::vector<const PulseViews*> neighbours(int64_t pulse) const;

  TakeFrames& take_;
  Reconstructor& reconstructor_;
  TakeSilhouetteRepair* repair_;
  const bool smooth_;
  const std::vector<int64_t> pulses_;  ///< of the take, increasing
  std::map<int64_t, WindowEntry> window_;
  int64_t next_pulse_ = -1;
  SegmentedFrames next_;  ///< frames of next_pulse_, already read for the repair
};

}  // namespace v3d::ctl
