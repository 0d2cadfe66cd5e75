// The volume of a compact frame.
#pragma once

#include <cstdint>
#include <optional>
#include <span>

#include "recon/hull/sparse_volume.h"

namespace v3d::recon {

/// The smallest grid from the origin of the frame's lattice that contains its volume; one brick for
/// a volume without voxels, because no grid is empty. Empty for a frame without a volume, and for
/// bytes that are no frame.
std::optional<VoxelGrid> frame_grid(std::span<const uint8_t> compact);

/// The voxels of the frame in `grid`, which has the origin and the voxel of frame_grid() and at
/// least its counts. Empty as above, and for a damaged frame. Works in the caller's TBB arena.
std::optional<SparseVolume> frame_volume(std::span<const uint8_t> compact, const VoxelGrid& grid);

}  // namespace v3d::recon
