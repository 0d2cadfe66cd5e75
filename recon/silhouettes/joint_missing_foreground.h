// Joint missing foreground: pieces that several silhouettes lost at the same place. No
// leave-one-out hull shows them, because each of the cameras removes the piece from the hulls of
// the others.
#pragma once

#include <span>
#include <vector>

#include "base/image/mask.h"
#include "recon/hull/voxel_grid.h"
#include "recon/hull/voxel_projection.h"

namespace v3d {

struct JointMissingOptions {
  int min_views = 4;  ///< cameras that must show a voxel as foreground, as for the hull
  /// A voxel needs at least this many supporting cameras, whose foreground nothing else explains,
  /// and `supporting_per_missing` of them for each camera that shows background.
  int min_supporting = 3;
  int supporting_per_missing = 2;
  /// Largest part of the cameras seeing a voxel that may show background.
  double max_missing_part = 0.3;
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

}  // namespace v3d
