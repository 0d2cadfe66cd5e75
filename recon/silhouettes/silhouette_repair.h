// Silhouettes that disagree with those of the other cameras: found, told apart, and mended where
// the evidence allows. Takai et al., "3D Video Technologies", leave this as future work.
//
// The hull of the others says what a camera should see. Where the camera shows background inside
// that silhouette, either it alone looks into a hollow that no other camera sees, which is what
// volume intersection lives on, or its mask has a piece missing, which cuts an arm off. Two things
// tell them apart:
//   - the piece is needed: without it, foreground of several other cameras is left that no part of
//     the volume explains;
//   - the piece looks solid: where the hull of the others stops the camera's rays, the camera sees
//     the same colours as its neighbours do there, and not what lies behind.
// Without such evidence the camera is believed: a hollow stays a hollow.
// What several cameras have lost at once no hull of the others shows: it is what a few deny, most
// show, and the foreground of many needs (joint_denial.h).
// Where the camera shows foreground outside the silhouette, nobody else sees anything: a phantom.
// Where both together are what moved since the pulse before, the camera shows that pulse.
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "base/camera_model.h"
#include "base/frame.h"
#include "base/geometry.h"
#include "base/mask.h"
#include "recon/hull/voxel_projection.h"
#include "recon/silhouettes/leave_one_out_hull.h"

namespace v3d {

enum class SilhouetteFaultKind {
  kMissingPiece,  ///< background where the others show that there is something
  kPhantomPiece,  ///< foreground where the others show that there is nothing
  kWholeCamera,   ///< more of the silhouette is wrong than right
  kPulseLate,     ///< the silhouette is that of the pulse before
};

struct SilhouetteFault {
  size_t camera = 0;  ///< of the rig
  SilhouetteFaultKind kind = SilhouetteFaultKind::kMissingPiece;
  Rect region;  ///< pixels, round all of it
  int64_t pixels = 0;
};

/// The masks a pulse earlier and a pulse later, one per camera of the rig, null where there is
/// none; or nothing: then no camera is found late.
struct NeighbourMasks {
  std::span<const Mask* const> before;
  std::span<const Mask* const> after;
};

struct RepairedSilhouettes {
  /// By camera of the rig; empty for a camera that is better left out, or had none.
  std::vector<std::optional<Mask>> masks;
  /// The same as they are without the neighbours: what the next pulse is held against, which
  /// otherwise would depend on all pulses before it.
  std::vector<std::optional<Mask>> alone;
  /// Cameras, rising, that show this pulse in their next frame; its mask was taken.
  std::vector<size_t> shown_later;
  std::vector<SilhouetteFault> faults;  ///< by camera, then from top to bottom
};

/// Keeps its working memory. One caller at a time; works in the caller's TBB arena; the result
/// depends on nothing but the arguments.
class SilhouetteRepair {
 public:
  /// Throws InputError as Intersector does. Faults narrower than about five voxels' pixels, three
  /// where colours tell of them, are not found.
  SilhouetteRepair(const Rig& rig, const Box& bounds, double voxel_m, int min_views);

  /// masks: one per camera of the rig, empty outside the view of the bounds, null where a camera
  /// takes no part. frames: the images behind them, for the evidence of colours; null where there
  /// is none.
  RepairedSilhouettes repair(std::span<const Mask* const> masks,
                             std::span<const Frame* const> frames,
                             const NeighbourMasks& neighbours = {});

 private:
  class Trial;
  const Rig rig_;
  const int min_views_;
  LeaveOneOutHull hulls_;
  LeaveOneOutHull around_;  ///< of a wider space: what stands beside the space is no phantom
  std::vector<VoxelCamera> lenses_;
  std::vector<int> radii_;  ///< by camera: what is no wider than twice this is no fault, pixels
};

}  // namespace v3d
