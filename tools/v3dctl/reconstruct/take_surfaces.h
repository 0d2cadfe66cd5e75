// The surfaces of a take, pulse by pulse, each held against those of the pulses beside it.
#pragma once

#include <cstdint>
#include <map>
#include <vector>

#include "daemon/recorded/take_frames.h"
#include "recon/reconstructor.h"
#include "v3dctl/reconstruct/silhouette_repair.h"

namespace v3d::ctl {

/// A pulse of a take, as far as its surface; the mesh has no colours yet.
struct TakeSurface {
  SegmentedFrames frames;
  double segment_ms = 0;
  SetAtWork work;
};

/// A surface is held against those one pulse to each side, which were carved with what was seen one
/// more pulse away; where silhouettes are mended these depend on those beside them. So the window
/// is two pulses to each side, or three, as far as the take has them; a surface depends on nothing
/// else: it is the same in whatever order and in however many parts a take is reconstructed. One
/// caller at a time, in its TBB arena.
class TakeSurfaces {
 public:
  /// All are borrowed; `mending` may be null. Without `steady` every pulse stands alone.
  TakeSurfaces(TakeFrames& take, Reconstructor& reconstructor, MaskMending* mending, bool steady);

  /// Requires that pulses rise, and that the take has them. Throws as TakeFrames::read().
  TakeSurface make(int64_t pulse);

 private:
  /// A surface before it is held against others, and what it is held against.
  struct Raw {
    TakeSurface surface;  ///< a hull at first; until it is given away
    Moment moment;
    bool deformed = false;
  };
  bool has(int64_t pulse) const;
  TakeSurface read(int64_t pulse);
  void look_at_before(int64_t pulse);
  void mend(int64_t pulse, SegmentedFrames& frames);
  void look_at(int64_t pulse);
  void deform(int64_t pulse);
  std::vector<const Moment*> beside(int64_t pulse) const;

  TakeFrames& take_;
  Reconstructor& reconstructor_;
  MaskMending* mending_;
  const bool steady_;
  const std::vector<int64_t> pulses_;  ///< of the take, rising
  std::map<int64_t, Raw> window_;
  int64_t ahead_pulse_ = -1;
  SegmentedFrames ahead_;  ///< of that pulse, read to mend the one before
};

}  // namespace v3d::ctl
