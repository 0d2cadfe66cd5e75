// Volume intersection: the visual hull of silhouettes, sound for partial views.
// Source: Takai et al., "3D Video Technologies", section 2.2 (silhouette volume intersection,
// extended to partial views of the object).
#pragma once

#include <tbb/enumerable_thread_specific.h>

#include <span>
#include <vector>

#include "base/camera_model.h"
#include "base/mask.h"
#include "recon/hull/intersection_octree.h"
#include "recon/hull/mask_pyramid.h"
#include "recon/hull/sparse_volume.h"
#include "recon/hull/voxel_projection.h"

namespace v3d {

/// What "occupied" means; normative. A camera sees a voxel when the voxel's centre lies before it
/// (z > 0), within the lens model's max_radius2(), and projects into the image (project_voxel(), in
/// single precision). A voxel is occupied when
///   - no camera that sees it has background at that pixel, and
///   - at least `min_views` cameras see it.
/// So a camera says nothing about what its image does not show: close-ups, objects cut by an
/// image's border, and cameras inside the space need no special care.
///
/// Holds what is computed once per rig. One caller at a time; works in the caller's TBB arena, and
/// the result depends on nothing but the arguments.
class Intersector {
 public:
  static constexpr int kMaxCameras = v3d::kMaxCameras;

  /// Throws InputError for more than kMaxCameras cameras, min_views < 1, or a grid with an axis
  /// beyond VoxelGrid::kMaxCount.
  Intersector(const VoxelGrid& grid, std::span<const CameraModel> cameras, int min_views);

  /// masks[c]: the silhouette of camera c, of its image size, or null when that camera takes no
  /// part. Requires as many masks as cameras.
  SparseVolume intersect(std::span<const Mask* const> masks);
  /// The same, into a volume that keeps its memory: the next frame allocates only where it is the
  /// largest so far (oneTBB's own tasks apart).
  void intersect(std::span<const Mask* const> masks, SparseVolume& volume);

 private:
  OctreeNode above_root(std::span<const Mask* const> masks) const;

  VoxelGrid grid_;
  std::vector<VoxelCamera> cameras_;
  std::vector<MaskPyramid> masks_;
  int min_views_;
  // Of the frame at work; they are here to keep their memory.
  std::vector<OctreeNode> nodes_, next_;
  tbb::enumerable_thread_specific<std::vector<PlacedBrick>> found_;
  std::vector<std::span<const PlacedBrick>> parts_;
};

}  // namespace v3d
