// Silhouette repair: detects silhouettes that contradict those of the other cameras, and corrects
// them where there is evidence. The paper (Takai et al.) leaves this as future work.
//
// The leave-one-out hull predicts what a camera should see. Where the camera shows background
// inside this prediction, either it alone looks into a concavity, or a piece of its mask is
// missing. A piece counts as missing when one of two tests succeeds:
// - Need: without the piece, foreground of several other cameras is not explained by any voxel.
// - Colour consistency: where the camera's rays meet the leave-one-out hull, it sees the same
//   colours as its neighbours (ColourConsistency).
//
// Without such evidence the mask stays as it is, so that concavities are preserved. Pieces that
// several cameras lost at once are found voxel by voxel (joint_missing_foreground()). Foreground
// outside the prediction that no other camera supports is a phantom. A camera whose differences
// match the motion since the previous pulse shows that pulse (frame_lag.h).
//
// Repair goes one camera at a time, largest defect first, because one bad silhouette makes correct
// neighbours look inconsistent.
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <span>
#include <string_view>
#include <vector>

#include "base/geometry/camera_model.h"
#include "base/geometry/mesh.h"
#include "base/geometry/rigid_transform.h"
#include "base/image/frame.h"
#include "base/image/mask.h"
#include "recon/hull/voxel_grid.h"
#include "recon/silhouettes/leave_one_out_hull.h"

namespace v3d::recon {

// Colour consistency test: do other cameras see the same colours at a point where one camera
// reports background?

/// Number of points that could be compared, and of those that agree.
struct ColourAgreement {
  int compared = 0;
  int agreeing = 0;

  /// True when significantly more points agree than by chance. A camera that sees past the surface
  /// agrees by chance only.
  bool is_consistent() const;
};

/// Compares one camera with its neighbours on a surface. Borrows all arguments while it lives. One
/// thread.
class ColourConsistency {
 public:
  /// `frames` has one entry per camera of the rig, null where there are no colours. `surface` is
  /// accurate to some voxels of `voxel_m` metres.
  ColourConsistency(const Rig& rig, std::span<const Frame* const> frames, size_t camera,
                    const Mesh& surface, double voxel_m);
  ~ColourConsistency();

  /// Compares the points of the surface that the camera sees within `piece` with the majority of
  /// its neighbours. The result is empty where the camera has no colours.
  ColourAgreement within(const Mask& piece) const;

 private:
  class Views;
  std::unique_ptr<const Views> views_;  ///< null: the camera has no colours
};

// Joint missing foreground: pieces that several silhouettes lost at the same place. No
// leave-one-out hull shows them, because each of the cameras removes the piece from the hulls of
// the others.

/// Returns true when a long computation must end without a result. Called from several threads at
/// once. Empty: never.
using StopRequest = std::function<bool()>;

struct JointMissingOptions {
  int min_views = 4;  ///< cameras that must show a voxel as foreground, as for the hull
  /// A voxel needs at least this many supporting cameras, whose foreground nothing else explains,
  /// and `supporting_per_missing` of them for each camera that shows background.
  int min_supporting = 3;
  int supporting_per_missing = 2;
  /// Largest part of the cameras seeing a voxel that may show background.
  double max_missing_part = 0.3;
  StopRequest should_stop{};  ///< the result is then incomplete
};

/// By camera, the pixels of missing foreground; of size 0 x 0 where there are none.
///
/// Among the voxels that would explain the same foreground, those with the fewest background
/// cameras count. So a camera that correctly looks into a concavity is not included. Voxels with a
/// single background camera are skipped, because the leave-one-out hull decides these better.
///
/// `masks` is null where a camera takes no part. `unexplained` is the foreground that the hull does
/// not explain, of size 0 x 0 where all is explained. Works in the caller's TBB arena.
std::vector<Mask> joint_missing_foreground(const VoxelGrid& grid,
                                           std::span<const VoxelCamera> lenses,
                                           std::span<const Mask* const> masks,
                                           std::span<const Mask> unexplained,
                                           const JointMissingOptions& options);

// Repair.

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
