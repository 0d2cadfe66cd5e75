#include "recon/surface/moment.h"

namespace v3d {

Moment::Moment(std::span<const CameraModel> models, std::span<const Frame* const> frames,
               const Mesh& hull, double voxel_m)
    : frames_(models.size()), numbers_(models.size(), -1) {
  std::vector<DeformCamera> cameras;
  for (size_t c = 0; c < models.size(); ++c) {
    if (frames[c] == nullptr || frames[c]->roi.empty()) continue;
    frames_[c] = *frames[c];
    numbers_[c] = static_cast<int>(cameras.size());
    cameras.push_back({&models[c], &frames_[c]});
  }
  seeing_ = SurfaceCameras(cameras, hull, voxel_m);
}

void Moment::set_surface(const Mesh& surface) {
  draw_depths(surface, seeing_.models, depths_, Faces::kFront);
}

SightsBeside sights_beside(const Moment& now, const Moment& then) {
  SightsBeside beside{&then.hollows, {}};
  for (size_t c = 0; c < then.numbers_.size(); ++c) {
    if (then.numbers_[c] < 0) continue;
    const int number = now.numbers_[c];
    beside.cameras.push_back({&then.seeing_.cameras[then.numbers_[c]],
                              number >= 0 ? &now.seeing_.cameras[number] : nullptr});
  }
  return beside;
}

}  // namespace v3d
