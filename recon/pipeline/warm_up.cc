#include "recon/pipeline/warm_up.h"

#include <algorithm>
#include <cmath>

namespace v3d {
namespace {

/// A ball of this radius has half as much surface again as a person has.
constexpr double kRadius = 0.5;

/// The disc that the ball is in the image; empty where the camera does not see its centre.
Mask silhouette(const CameraModel& model, const Eigen::Vector3d& centre, double radius) {
  Mask mask(model.size());
  const auto pixel = model.project(centre);
  if (!pixel) return mask;
  const double pixels = model.matrix()(0, 0) * radius / (centre - model.center()).norm();
  const int last = model.size().height - 1;
  const int top = std::clamp(static_cast<int>(pixel->y() - pixels), 0, last);
  const int bottom = std::clamp(static_cast<int>(pixel->y() + pixels), 0, last);
  for (int y = top; y <= bottom; ++y) {
    const double half = std::sqrt(std::max(0.0, pixels * pixels - std::pow(y - pixel->y(), 2)));
    const int begin = std::clamp(static_cast<int>(pixel->x() - half), 0, model.size().width);
    const int end = std::clamp(static_cast<int>(pixel->x() + half), begin, model.size().width);
    mask.fill_row(y, begin, end);
  }
  return mask;
}

}  // namespace

FrameSet warm_up_frame_set(const Rig& rig, const Box& bounds) {
  const double radius = std::min(kRadius, 0.25 * bounds.size().minCoeff());
  FrameSet set;
  for (const RigCamera& camera : rig) {
    Image raw(camera.model.size(), PixelFormat::kBayerRG8);
    std::fill(raw.bytes.begin(), raw.bytes.end(), uint8_t{128});
    set.frames.push_back(
        observe(camera.name, {}, raw.view(), silhouette(camera.model, bounds.center(), radius)));
  }
  return set;
}

}  // namespace v3d
