// What several cameras deny together and most others show: pieces that more than one silhouette
// has lost at once. The hull of all others cannot tell of them, since each of the cameras keeps the
// piece out of the others' hulls.
#pragma once

#include <span>
#include <vector>

#include "base/mask.h"
#include "recon/hull/voxel_grid.h"
#include "recon/hull/voxel_projection.h"

namespace v3d {

struct JointMissingOptions {
  int min_views = 4;  ///< foreground in so many cameras, as the hull asks for
  /// A voxel is asked for by so many cameras at least whose foreground nothing explains there, and
  /// by so many for each camera that denies it.
  int min_supporting = 3;
  int supporting_per_missing = 2;
  /// Part of the cameras that see a voxel that may deny it.
  double max_missing_part = 0.3;
};

/// By camera, the pixels in which it denies such voxels; of size 0 x 0 where there are none. Of the
/// voxels that would explain the same foreground those count that the fewest deny: a camera that
/// rightly looks into a hollow is not among them.
/// masks: null where a camera takes no part. unexplained: the foreground that the hull does not
/// explain, of size 0 x 0 where all is. Voxels that one camera alone denies are passed over: of
/// them the hull of the others tells more. Works in the caller's TBB arena; pure.
std::vector<Mask> joint_missing_foreground(const VoxelGrid& grid,
                                           std::span<const VoxelCamera> lenses,
                                           std::span<const Mask* const> masks,
                                           std::span<const Mask> unexplained,
                                           const JointMissingOptions& options);

}  // namespace v3d
