// Foreground that a volume covered before a part was taken out of it, and does not cover after.
#pragma once

#include <span>
#include <vector>

#include "recon/hull/sparse_volume.h"
#include "recon/visibility/surface_camera.h"

namespace v3d {

/// The foreground pixels of a camera where `depth` shows a surface.
Mask covered_pixels(const SurfaceCamera& camera, const DepthBuffer& depth);

/// The pixels of `before`, and those next to them, where `after` shows no surface. If they are
/// covered() foreground, something is there, and so a hull must be. Rims of one or two pixels are
/// left out: put back, they would stand out as fins.
Mask uncovered_pixels(const Mask& before, const DepthBuffer& after);

/// Of `some` voxels of the volume those whose centre a camera sees at one of its `pixels`; a brick
/// for each of the volume. Works in the caller's TBB arena.
std::vector<Brick> voxels_at(std::span<const Mask> pixels, std::span<const SurfaceCamera> cameras,
                             const SparseVolume& volume, std::span<const Brick> some);

}  // namespace v3d
