#include "recon/silhouettes/leave_one_out_hull.h"

#include <algorithm>

#include "recon/hull/voxel_grid.h"
#include "recon/render/renderer.h"

namespace v3d::recon {

double voxel_for_silhouettes(const Rig& rig, const Box& bounds) {
  int pixels = 0;
  for (const RigCamera& camera : rig) {
    pixels = std::max({pixels, camera.model.size().width, camera.model.size().height});
  }
  return (bounds.max - bounds.min).maxCoeff() / std::clamp(pixels / 4, 1, 256);
}

LeaveOneOutHull::LeaveOneOutHull(const Rig& rig, const Box& bounds, double voxel_m, int min_views)
    : models_(models_of(rig)),
      grid_(VoxelGrid::covering(bounds, voxel_m)),
      intersector_(grid_, models_, min_views) {}

const SparseVolume& LeaveOneOutHull::volume(std::span<const Mask* const> masks, size_t camera) {
  others_.assign(masks.begin(), masks.end());
  others_[camera] = nullptr;
  return volume(others_);
}

const Mesh& LeaveOneOutHull::surface(std::span<const Mask* const> masks, size_t camera) {
  marching_cubes_.run(volume(masks, camera), surface_);
  return surface_;
}

Mask LeaveOneOutHull::silhouette(std::span<const Mask* const> masks, size_t camera) {
  return draw_silhouette(surface(masks, camera), models_[camera]);
}

std::vector<Mask> LeaveOneOutHull::silhouettes_of_each(std::span<const Mask* const> masks) {
  std::vector<Mask> silhouettes(masks.size());
  for (size_t c = 0; c < masks.size(); ++c) {
    if (masks[c] != nullptr) silhouettes[c] = silhouette(masks, c);
  }
  return silhouettes;
}

const SparseVolume& LeaveOneOutHull::volume(std::span<const Mask* const> masks) {
  pause_();
  intersector_.intersect(masks, volume_);
  return volume_;
}

std::vector<Mask> LeaveOneOutHull::silhouettes(std::span<const Mask* const> masks) {
  marching_cubes_.run(volume(masks), surface_);
  return draw_silhouettes(surface_, models_);
}

}  // namespace v3d::recon
