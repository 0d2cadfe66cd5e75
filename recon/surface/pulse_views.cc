#include "recon/surface/pulse_views.h"

namespace v3d {

PulseViews::PulseViews(std::span<const CameraModel> models, std::span<const Frame* const> frames,
                       const Mesh& hull, double voxel_m)
    : frames_(models.size()), numbers_(models.size(), -1) {
  std::vector<DeformCamera> cameras;
  for (size_t c = 0; c < models.size(); ++c) {
    if (frames[c] == nullptr || frames[c]->roi.empty()) continue;
    frames_[c] = *frames[c];
    numbers_[c] = static_cast<int>(cameras.size());
    cameras.push_back({&models[c], &frames_[c]});
  }
  surface_cameras_ = SurfaceCameras(cameras, hull, voxel_m);
}

void PulseViews::set_surface(const Mesh& surface) {
  draw_depths(surface, surface_cameras_.models, depths_, Faces::kFront);
}

NeighbourSamples neighbour_samples(const PulseViews& now, const PulseViews& then) {
  NeighbourSamples samples{&then.stereo_samples, {}};
  for (size_t c = 0; c < then.numbers_.size(); ++c) {
    if (then.numbers_[c] < 0) continue;
    const int number = now.numbers_[c];
    samples.cameras.push_back({&then.surface_cameras_.cameras[then.numbers_[c]],
                               number >= 0 ? &now.surface_cameras_.cameras[number] : nullptr});
  }
  return samples;
}

}  // namespace v3d
