// Volume intersection: the visual hull of silhouettes, correct for partial views. Source: section
// 2.2 of the paper (silhouette volume intersection, extended to partial views of the object).
#pragma once

#include <tbb/enumerable_thread_specific.h>

#include <span>
#include <vector>

#include "base/geometry/camera_model.h"
#include "base/image/mask.h"
#include "recon/hull/intersection_octree.h"
#include "recon/hull/mask_pyramid.h"
#include "recon/hull/sparse_volume.h"
#include "recon/hull/voxel_projection.h"

namespace v3d {

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
  static constexpr int kMaxCameras = v3d::kMaxCameras;

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

}  // namespace v3d
