// Leave-one-out hull: the visual hull of all cameras but one. It predicts what the remaining camera
// should see.
#pragma once

#include <functional>
#include <span>
#include <utility>
#include <vector>

#include "base/geometry/camera_model.h"
#include "base/geometry/rigid_transform.h"
#include "base/image/mask.h"
#include "recon/hull/intersect.h"
#include "recon/hull/sparse_volume.h"

namespace v3d::recon {

/// Edge of the voxels, in metres, to compare silhouettes with leave-one-out hulls in `bounds`.
/// There are as many voxels along the longest edge as a quarter of the pixels along the rig's
/// longest image edge, 256 at most. So a voxel is about four pixels wide in a camera that sees the
/// bounds as a whole, and a rig of small images takes less time.
double voxel_for_silhouettes(const Rig& rig, const Box& bounds);

/// Keeps its working memory. References that it returns are valid until the next call. One caller
/// at a time; works in the caller's TBB arena. Deterministic.
class LeaveOneOutHull {
 public:
  /// `bounds` in metres in the world. Throws InputError as Intersector does.
  LeaveOneOutHull(const Rig& rig, const Box& bounds, double voxel_m, int min_views);

  const VoxelGrid& grid() const { return grid_; }
  /// `pause` is called before each hull, by the thread that asked for it. It may wait.
  void set_pause(std::function<void()> pause) { pause_ = std::move(pause); }

  /// The hull of all masks except that of `camera`. `masks` has one entry per camera of the rig,
  /// null where a camera takes no part.
  const SparseVolume& volume(std::span<const Mask* const> masks, size_t camera);
  /// Marching cubes surface of volume().
  const Mesh& surface(std::span<const Mask* const> masks, size_t camera);
  /// Silhouette of volume() in `camera`. It contains the true silhouette, except for errors of the
  /// other masks and the width of a voxel.
  Mask silhouette(std::span<const Mask* const> masks, size_t camera);
  /// silhouette() for every camera that has a mask; of size 0 x 0 for the others.
  std::vector<Mask> silhouettes_of_each(std::span<const Mask* const> masks);
  /// The hull of all masks.
  const SparseVolume& volume(std::span<const Mask* const> masks);
  /// The silhouette of the hull of all masks in every camera.
  std::vector<Mask> silhouettes(std::span<const Mask* const> masks);

 private:
  const std::vector<CameraModel> models_;
  const VoxelGrid grid_;
  Intersector intersector_;
  MarchingCubes marching_cubes_;
  std::vector<const Mask*> others_;
  SparseVolume volume_;
  Mesh surface_;
  std::function<void()> pause_ = [] {};
};

}  // namespace v3d::recon
