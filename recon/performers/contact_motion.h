// Block matching of volumes: the motion of a block from one volume to the next.
#pragma once

#include <array>
#include <cstdint>
#include <span>

#include "recon/hull/sparse_volume.h"

namespace v3d::recon {

/// A number of voxels along x, y and z.
using VoxelStep = std::array<int, 3>;

/// The voxels of a set in the cube of 8 x 8 x 8 voxels whose lowest voxel is `lowest`, which may
/// lie outside the grid. `set` has one brick for each of `volume`.
codec::Brick window_at(const SparseVolume& volume, std::span<const codec::Brick> set,
                       const VoxelStep& lowest);

/// The cube at brick `at`, moved back by `step`.
inline VoxelStep moved_back(codec::BrickCoord at, const VoxelStep& step) {
  return {codec::kBrickEdge * at.x - step[0], codec::kBrickEdge * at.y - step[1],
          codec::kBrickEdge * at.z - step[2]};
}

/// The step from `previous` to `volume` for which the bricks `block` of `volume` differ in the
/// fewest voxels: at most 7 voxels along each axis, found coarse to fine (three-step search). Of
/// equal steps the first, and no motion before all others. At most 48 bricks are compared, evenly
/// chosen from the block. Requires the same grid, and a block that is not empty. Any thread.
/// Source: Koga, Iinuma, Hirano, Iijima and Ishiguro, "Motion compensated interframe coding for
/// video conferencing", 1981.
VoxelStep block_motion(const SparseVolume& volume, const SparseVolume& previous,
                       std::span<const uint32_t> block);

}  // namespace v3d::recon
