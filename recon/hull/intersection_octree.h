// The octree of the volume intersection: from a cube of space and the cameras that have not yet
// decided about it to occupied bricks.
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

/// What every part of one volume looks at; nothing is owned. One mask per camera.
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
  BrickCoord at;       ///< its first brick
  int full_views = 0;  ///< cameras that see all of it on foreground
  /// Cameras that may see it on background, or whose view counts. Those that are neither here nor
  /// in full_views see none of it, or cannot change the result.
  int undecided_count = 0;
  std::array<uint16_t, kMaxCameras> undecided;  // NOLINT: not worth filling

  CameraList cameras() const { return {undecided.data(), static_cast<size_t>(undecided_count)}; }
};

/// One step down: appends the children that need another look to `nodes`, and bricks that are
/// decided to `bricks`. Requires node.level > 0. Vectorised for the processor it runs on; every
/// processor gives the same bits, here and below.
void split_node(const IntersectionScene& scene, const OctreeNode& node,
                std::vector<OctreeNode>& nodes, std::vector<PlacedBrick>& bricks);

/// All the way down: appends all occupied bricks of the node. Requires node.level > 0.
void intersect_node(const IntersectionScene& scene, const OctreeNode& node,
                    std::vector<PlacedBrick>& bricks);

/// Where a camera may see the voxels of a cube.
struct CubeFootprint {
  bool may_see = true;    ///< false: sees none of them
  bool is_known = false;  ///< false: the members below say nothing
  bool sees_all = false;
  int x0 = 0, y0 = 0, x1 = 0, y1 = 0;  ///< pixels, inclusive, inside the image
};

/// Of the 8 children of a node; for tests.
std::array<CubeFootprint, 8> child_footprints(const IntersectionScene& scene,
                                              const OctreeNode& node, int camera);

}  // namespace v3d
