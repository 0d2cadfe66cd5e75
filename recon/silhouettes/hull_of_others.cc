#include "recon/silhouettes/hull_of_others.h"

#include "recon/hull/voxel_grid.h"
#include "recon/render/silhouette.h"

namespace v3d {

HullOfOthers::HullOfOthers(const Rig& rig, const Box& bounds, double voxel_m, int min_views)
    : models_(models_of(rig)),
      grid_(VoxelGrid::covering(bounds, voxel_m)),
      intersector_(grid_, models_, min_views) {}

const SparseVolume& HullOfOthers::volume(std::span<const Mask* const> masks, size_t camera) {
  others_.assign(masks.begin(), masks.end());
  others_[camera] = nullptr;
  return volume(others_);
}

const Mesh& HullOfOthers::surface(std::span<const Mask* const> masks, size_t camera) {
  marching_cubes_.run(volume(masks, camera), surface_);
  return surface_;
}

Mask HullOfOthers::silhouette(std::span<const Mask* const> masks, size_t camera) {
  return draw_silhouette(surface(masks, camera), models_[camera]);
}

std::vector<Mask> HullOfOthers::silhouettes_of_each(std::span<const Mask* const> masks) {
  std::vector<Mask> silhouettes(masks.size());
  for (size_t c = 0; c < masks.size(); ++c) {
    if (masks[c] != nullptr) silhouettes[c] = silhouette(masks, c);
  }
  return silhouettes;
}

const SparseVolume& HullOfOthers::volume(std::span<const Mask* const> masks) {
  intersector_.intersect(masks, volume_);
  return volume_;
}

std::vector<Mask> HullOfOthers::silhouettes(std::span<const Mask* const> masks) {
  marching_cubes_.run(volume(masks), surface_);
  return draw_silhouettes(surface_, models_);
}

}  // namespace v3d
