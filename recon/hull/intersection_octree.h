// Octree of the volume intersection: descends from a cube of space, with the cameras that are still
// undecided about it, to occupied bricks.
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "recon/hull/mask_pyramid.h"
#include "recon/hull/sparse_volume.h"
#include "recon/hull/voxel_projection.h"

namespace v3d {

inline constexpr int kMaxCameras = 256;

/// Inputs of one intersection, all borrowed. One mask per camera.
struct IntersectionScene {
  const VoxelGrid& grid;
  std::span<const VoxelCamera> cameras;
  std::span<const MaskPyramid> masks;
  int min_views = 1;
};

using CameraList = std::span<const uint16_t>;

/// A cube of 2^level bricks along each edge, and what is known about all of its voxels.
struct OctreeNode {
  int level = 0;
  BrickCoord at;       ///< its brick with the lowest coordinates
  int full_views = 0;  ///< cameras that see the whole cube as foreground
  /// Number of undecided cameras: those that may see background, or whose view counts for
  /// min_views. All others see none of the cube, all of it, or cannot change the result.
  int undecided_count = 0;
  std::array<uint16_t, kMaxCameras> undecided;  // NOLINT: not worth filling

  CameraList cameras() const { return {undecided.data(), static_cast<size_t>(undecided_count)}; }
};

/// One step down: appends undecided children to `nodes`, and occupied bricks to `bricks`. Requires
/// node.level > 0. Vectorised by run-time dispatch; every instruction set gives the same bits.
void split_node(const IntersectionScene& scene, const OctreeNode& node,
                std::vector<OctreeNode>& nodes, std::vector<PlacedBrick>& bricks);

/// All steps down: appends all occupied bricks of the node to `bricks`. Requires node.level > 0.
/// Vectorised by run-time dispatch; every instruction set gives the same bits.
void intersect_node(const IntersectionScene& scene, const OctreeNode& node,
                    std::vector<PlacedBrick>& bricks);

/// Bounds of the projection of a cube into one camera, by interval arithmetic through the whole
/// lens model.
struct CubeFootprint {
  bool may_see = true;    ///< false: the camera sees none of the voxels
  bool is_known = false;  ///< false: the members below are not valid
  bool sees_all = false;
  int x0 = 0, y0 = 0, x1 = 0, y1 = 0;  ///< pixels, inclusive, inside the image
};

/// Footprints of the 8 children of a node; for tests.
std::array<CubeFootprint, 8> child_footprints(const IntersectionScene& scene,
                                              const OctreeNode& node, int camera);

}  // namespace v3d
