// Silhouette repair: detects silhouettes that contradict those of the other cameras, and corrects
// them where there is evidence. The paper (Takai et al.) leaves this as future work.
//
// The leave-one-out hull predicts what a camera should see. Where the camera shows background
// inside this prediction, either it alone looks into a concavity, or a piece of its mask is
// missing. A piece counts as missing when one of two tests succeeds:
// - Need: without the piece, foreground of several other cameras is not explained by any voxel.
// - Colour consistency: where the camera's rays meet the leave-one-out hull, it sees the same
//   colours as its neighbours (missing_foreground.h).
//
// Without such evidence the mask stays as it is, so that concavities are preserved. Pieces that
// several cameras lost at once are found voxel by voxel (missing_foreground.h). Foreground
// outside the prediction that no other camera supports is a phantom. A camera whose differences
// match the motion since the previous pulse shows that pulse (frame_lag.h).
//
// Repair goes one camera at a time, largest defect first, because one bad silhouette makes correct
// neighbours look inconsistent.
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <string_view>
#include <vector>

#include "base/geometry/camera_model.h"
#include "base/geometry/rigid_transform.h"
#include "base/image/frame.h"
#include "base/image/mask.h"
#include "recon/hull/voxel_grid.h"
#include "recon/silhouettes/leave_one_out_hull.h"
#include "recon/silhouettes/missing_foreground.h"

namespace v3d::recon {

enum class SilhouetteFaultKind {
  kMissingPiece,  ///< background where the other cameras show foreground
  kPhantomPiece,  ///< foreground where the other cameras show background
  kWholeCamera,   ///< most of the silhouette is wrong
  kPulseLate,     ///< the silhouette shows the previous pulse
};

/// "missing piece", "phantom piece", "whole camera", "pulse late".
std::string_view name(SilhouetteFaultKind kind);

struct SilhouetteFault {
  size_t camera = 0;  ///< of the rig
  SilhouetteFaultKind kind = SilhouetteFaultKind::kMissingPiece;
  Rect region;  ///< bounding box, pixels
  int64_t pixels = 0;
};

/// The masks of the previous and of the next pulse, one per camera of the rig, null where there is
/// none. Both empty: frame lag is not tested.
struct NeighbourMasks {
  std::span<const Mask* const> before;
  std::span<const Mask* const> after;
};

struct RepairedSilhouettes {
  /// By camera of the rig; empty for a camera that had no mask or should be left out.
  std::vector<std::optional<Mask>> masks;
  /// The masks repaired without NeighbourMasks. Pass them as `before` at the next pulse; otherwise
  /// its result would depend on all earlier pulses.
  std::vector<std::optional<Mask>> alone;
  /// Cameras, ascending, that show this pulse in their next frame; the mask of that frame was used.
  std::vector<size_t> shown_later;
  std::vector<SilhouetteFault> faults;  ///< by camera, then from top to bottom
};

/// Edge of the voxels, in metres, with which the silhouettes of a reconstruction are repaired: that
/// of the reconstruction, or larger where the bounds would have more than 220 voxels along an edge.
double voxel_for_repair(const Box& bounds, double voxel_m);

/// Keeps its working memory. One caller at a time; works in the caller's TBB arena. Deterministic.
class SilhouetteRepair {
 public:
  /// `bounds` is the reconstructed space (world, metres). Defects narrower than about five voxels
  /// in the image are not found; with colours, three.
  ///
  /// Throws InputError as Intersector does.
  SilhouetteRepair(const Rig& rig, const Box& bounds, double voxel_m, int min_views);

  /// `masks` has one entry per camera of the rig, cut to bounds_mask(), null where a camera takes
  /// no part. `frames` are the images of the masks for the colour test, null where there are none.
  RepairedSilhouettes repair(std::span<const Mask* const> masks,
                             std::span<const Frame* const> frames,
                             const NeighbourMasks& neighbours = {});

  /// repair() without neighbours, which ends early and without a result when `should_stop` returns
  /// true. It is called at least once for each leave-one-out hull.
  std::optional<RepairedSilhouettes> repair_unless(const StopRequest& should_stop,
                                                   std::span<const Mask* const> masks,
                                                   std::span<const Frame* const> frames);

 private:
  class Trial;
  const Rig rig_;
  const int min_views_;
  LeaveOneOutHull hulls_;
  LeaveOneOutHull around_;  ///< of a wider space: objects beside the bounds are not phantoms
  std::vector<VoxelCamera> lenses_;
  std::vector<int> radii_;  ///< by camera, pixels: pieces up to twice as wide are ignored
};

}  // namespace v3d::recon
