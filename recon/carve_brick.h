// What one camera says about the voxels of one brick: the inner loop of the volume intersection.
#pragma once

#include "recon/mask_pyramid.h"
#include "recon/sparse_volume.h"
#include "recon/voxel_projection.h"

namespace v3d {

/// Both are subsets of the candidates.
struct BrickView {
  Brick seen{};        ///< voxels whose centre the camera sees (project_voxel)
  Brick background{};  ///< voxels whose centre it sees on background
};

/// Looks only at voxels in `candidates`. Vectorised for the processor it runs on; every processor
/// gives the same bits.
BrickView view_brick(const VoxelCamera& camera, const MaskPyramid& mask, BrickCoord at,
                     const Brick& candidates);

}  // namespace v3d
