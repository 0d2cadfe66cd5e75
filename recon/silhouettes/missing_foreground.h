// Evidence for missing foreground: colour consistency, several cameras at once.
#pragma once

#include <functional>
#include <memory>
#include <span>
#include <vector>

#include "base/geometry/camera_model.h"
#include "base/geometry/mesh.h"
#include "base/image/frame.h"
#include "base/image/mask.h"
#include "recon/hull/voxel_grid.h"

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

}  // namespace v3d::recon
