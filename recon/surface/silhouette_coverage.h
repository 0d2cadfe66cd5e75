// Silhouette coverage: the foreground that a volume explains, before and after a part of it is
// removed.
#pragma once

#include <span>
#include <vector>

#include "recon/hull/sparse_volume.h"
#include "recon/visibility/surface_camera.h"

namespace v3d {

/// The foreground pixels of `camera` where `depth`, its depth buffer, shows a surface.
Mask covered_pixels(const SurfaceCamera& camera, const DepthBuffer& depth);

/// The pixels of `before`, and those next to them, where `after` shows no surface. `before` is
/// covered_pixels() of the volume before carving, `after` the depth buffer of the volume after it.
/// Rims of one or two pixels are left out, because voxels restored for them would stand out as
/// fins.
Mask uncovered_pixels(const Mask& before, const DepthBuffer& after);

/// The voxels of `some` whose centre projects to one of a camera's `pixels`. `some` and the result
/// have one brick for each of the volume's. Works in the caller's TBB arena.
std::vector<Brick> voxels_at(std::span<const Mask> pixels, std::span<const SurfaceCamera> cameras,
                             const SparseVolume& volume, std::span<const Brick> some);

}  // namespace v3d
