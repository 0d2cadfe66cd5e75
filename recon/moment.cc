#include "recon/moment.h"

#include <tbb/parallel_for.h>

namespace v3d {

Moment::Moment(std::span<const CameraModel> models, std::span<const Frame* const> frames,
               const Mesh& surface, double voxel_m)
    : frames_(models.size()), views_(models.size()) {
  const Eigen::Vector3f middle = middle_of(surface);
  tbb::parallel_for(size_t{0}, models.size(), [&](size_t c) {
    if (frames[c] == nullptr || frames[c]->roi.empty()) return;
    frames_[c] = *frames[c];
    views_[c].emplace(View{
        SurfaceCamera({&models[c], &frames_[c]}, needless_halvings(models[c], middle, voxel_m)),
        draw_depth(surface, models[c], Faces::kFront)});
  });
}

}  // namespace v3d
