// Volume intersection.
#pragma once

#include <tbb/enumerable_thread_specific.h>

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "base/geometry/camera_model.h"
#include "base/image/mask.h"
#include "recon/hull/mask_pyramid.h"
#include "recon/hull/sparse_volume.h"
#include "recon/hull/voxel_grid.h"

namespace v3d::recon {

// Octree of the volume intersection: descends from a cube of space, with the cameras that are still
// undecided about it, to occupied bricks.

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
  codec::BrickCoord at;  ///< its brick with the lowest coordinates
  int full_views = 0;    ///< cameras that see the whole cube as foreground
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

// Volume intersection: the visual hull of silhouettes, correct for partial views. Source: section
// 2.2 of the paper (silhouette volume intersection, extended to partial views of the object).

/// Normative definition of "occupied". A camera sees a voxel when the centre of the voxel lies in
/// front of it (z > 0), within max_radius2() of the lens model, and projects into the image
/// (project_voxel(), in single precision). A voxel is occupied when
/// - no camera that sees it has background at that pixel, and
/// - at least `min_views` cameras see it.
///
/// So a camera decides nothing about space outside its image. Close-ups, objects cut by an image
/// border, and cameras inside the space need no special treatment.
///
/// Holds what is computed once per rig. One caller at a time; works in the caller's TBB arena.
/// Deterministic.
class Intersector {
 public:
  static constexpr int kMaxCameras = v3d::recon::kMaxCameras;

  /// Throws InputError for more than kMaxCameras cameras, min_views < 1, or more than
  /// VoxelGrid::kMaxCount voxels along an axis.
  Intersector(const VoxelGrid& grid, std::span<const CameraModel> cameras, int min_views);

  /// masks[c] is the silhouette of camera c, of its image size; null when that camera takes no
  /// part. Requires one entry per camera.
  SparseVolume intersect(std::span<const Mask* const> masks);
  /// Writes the result to `volume` and reuses its memory.
  void intersect(std::span<const Mask* const> masks, SparseVolume& volume);

 private:
  OctreeNode above_root(std::span<const Mask* const> masks) const;

  VoxelGrid grid_;
  std::vector<VoxelCamera> cameras_;
  std::vector<MaskPyramid> masks_;
  int min_views_;
  // Working memory of one call.
  std::vector<OctreeNode> nodes_, next_;
  tbb::enumerable_thread_specific<std::vector<PlacedBrick>> found_;
  std::vector<std::span<const PlacedBrick>> parts_;
};

}  // namespace v3d::recon
