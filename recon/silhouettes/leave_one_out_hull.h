// What the other cameras expect of one camera: the hull of their silhouettes, as that camera would
// see it.
#pragma once

#include <span>
#include <vector>

#include "base/camera_model.h"
#include "base/geometry.h"
#include "base/mask.h"
#include "recon/hull/intersect.h"
#include "recon/hull/marching_cubes.h"

namespace v3d {

/// Keeps its working memory, and what it returns by reference until the next call. One caller at a
/// time; works in the caller's TBB arena; results depend on nothing but the arguments.
class LeaveOneOutHull {
 public:
  /// Throws InputError as Intersector does.
  LeaveOneOutHull(const Rig& rig, const Box& bounds, double voxel_m, int min_views);

  const VoxelGrid& grid() const { return grid_; }

  /// The hull of all masks but that of `camera`. masks: one per camera of the rig, null where a
  /// camera takes no part.
  const SparseVolume& volume(std::span<const Mask* const> masks, size_t camera);
  /// Its surface.
  const Mesh& surface(std::span<const Mask* const> masks, size_t camera);
  /// Its silhouette in `camera`. As the true silhouette lies inside every hull, it holds the
  /// camera's own, but for what either of them has wrong and for the width of a voxel.
  Mask silhouette(std::span<const Mask* const> masks, size_t camera);
  /// The same for every camera that has a mask; of size 0 x 0 for the others.
  std::vector<Mask> silhouettes_of_each(std::span<const Mask* const> masks);
  /// The hull of all masks.
  const SparseVolume& volume(std::span<const Mask* const> masks);
  /// Its silhouette in every camera.
  std::vector<Mask> silhouettes(std::span<const Mask* const> masks);

 private:
  const std::vector<CameraModel> models_;
  const VoxelGrid grid_;
  Intersector intersector_;
  MarchingCubes marching_cubes_;
  std::vector<const Mask*> others_;
  SparseVolume volume_;
  Mesh surface_;
};

}  // namespace v3d
