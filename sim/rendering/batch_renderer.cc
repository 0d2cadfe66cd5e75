#include "sim/rendering/batch_renderer.h"

#include "sim/rendering/parallel.h"

namespace v3d::sim {

BatchRenderer::BatchRenderer(const Rig& rig, const RenderOptions& options)
    : options_(options), cameras_(rig.size()) {
  for_each_index(rig.size(), [&](size_t i) {
    cameras_[i] = std::make_unique<CameraRenderer>(rig[i], options);
  });
}

std::vector<Image> BatchRenderer::render_all(std::optional<double> seconds,
                                             uint64_t exposure_number) {
  std::optional<PerformerExposure> shot;
  if (seconds) {
    shot = expose_performer(*seconds, options_.seed, options_.exposure_s);
  }
  std::vector<Image> images(cameras_.size());
  for_each_index(cameras_.size(), [&](size_t i) {
    images[i] = cameras_[i]->render(shot ? &*shot : nullptr, exposure_number);
  });
  return images;
}

}  // namespace v3d::sim
