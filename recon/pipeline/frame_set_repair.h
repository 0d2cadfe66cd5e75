// Silhouette repair of one frame set, before its reconstruction: live, and offline for the same
// result.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "base/geometry/camera_model.h"
#include "base/image/mask.h"
#include "recon/pipeline/frame_set.h"
#include "recon/pipeline/reconstructor.h"
#include "recon/silhouettes/silhouette_repair.h"

namespace v3d::recon {

/// A mask that the repair has replaced, or that of a camera which it has left out.
struct ReplacedMask {
  std::string camera;
  Mask given;
};

struct RepairedFrameSet {
  std::vector<SilhouetteFault> faults;  ///< as in RepairedSilhouettes
  std::vector<ReplacedMask> replaced;   ///< in the order of the rig
};

/// Runs SilhouetteRepair on single frame sets. The result depends only on the frames of the set as
/// observe() makes them: no other pulse is used, and colours are compared only within the boxes of
/// the masks. So `v3d-recond` and `v3dctl reconstruct --repair-pulses` have the same bytes.
///
/// Keeps its working memory. One caller at a time; works in the caller's TBB arena. Deterministic.
class FrameSetRepair {
 public:
  /// Throws InputError as SilhouetteRepair does.
  FrameSetRepair(const Rig& rig, const ReconstructOptions& options);

  /// Repairs the masks of `set`. A camera with a fault gets the repaired mask, which is empty
  /// outside the view of the bounds; a camera that is wrong as a whole loses its frame. All other
  /// frames, and the pixels of all frames, stay as they are. So a set without faults is unchanged.
  ///
  /// Ends early when `should_stop` returns true (SilhouetteRepair::repair_unless()). Then `set` is
  /// unchanged and the result empty.
  std::optional<RepairedFrameSet> repair(FrameSet& set, const StopRequest& should_stop = {});

 private:
  const Rig rig_;
  SilhouetteRepair repair_;
  std::vector<Mask> views_;  ///< of the bounds, by camera
};

/// Puts the replaced masks back. The frame of a camera that was left out returns without pixels.
void restore_masks(std::vector<ReplacedMask> replaced, FrameSet& set);

}  // namespace v3d::recon
