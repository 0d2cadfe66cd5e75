#include "recon/template_windows.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>

namespace v3d {
namespace {

using Eigen::Vector2f;
using Eigen::Vector3f;

struct Candidate {
  float facing = 0;
  size_t camera = 0;
  SurfaceCamera::Seen seen;
};

/// The best so far, those that face most first.
class Candidates {
 public:
  explicit Candidates(int most) : most_(std::min(most, kMostWindowViews)) {}
  bool wants(float facing) const { return count_ < most_ || facing > list_[count_ - 1].facing; }
  void add(const Candidate& candidate) {
    int i = count_ < most_ ? count_++ : count_ - 1;
    for (; i > 0 && list_[i - 1].facing < candidate.facing; --i) list_[i] = list_[i - 1];
    list_[i] = candidate;
  }
  std::span<const Candidate> all() const { return {list_.data(), static_cast<size_t>(count_)}; }

 private:
  int most_;
  int count_ = 0;
  std::array<Candidate, kMostWindowViews> list_;
};

/// A slanted surface changes its depth within a pixel; by no more than this many pixels' widths.
constexpr float kMostSlant = 6;

Candidates those_that_see(const TemplateWindow& window, std::span<const SurfaceCamera> cameras,
                          std::span<const DepthBuffer> depths, const WindowChoice& choice) {
  Candidates best(choice.most_views);
  for (size_t c = 0; c < cameras.size(); ++c) {
    const Vector3f way = cameras[c].center() - window.place;
    const float facing = way.dot(window.normal) / way.norm();
    if (!(facing >= choice.least_facing) || !best.wants(facing)) continue;
    const auto seen = cameras[c].project(window.place);
    if (!seen) continue;
    const float slope = std::sqrt(std::max(0.0F, 1 - facing * facing)) / facing;
    const float slant = cameras[c].pixel_m_per_m() * seen->z * std::min(slope, kMostSlant);
    if (cameras[c].sees(*seen, depths[c], choice.tolerance_m + slant)) {
      best.add({facing, c, *seen});
    }
  }
  return best;
}

/// One of the window's axes; which, does not matter.
Vector3f axis_across(const Vector3f& normal) {
  const Vector3f other = std::abs(normal.z()) < 0.9F ? Vector3f::UnitZ() : Vector3f::UnitX();
  return normal.cross(other).normalized();
}

bool corners_in_silhouette(const SurfaceCamera& camera, const Vector2f& middle,
                           const Vector2f& across, const Vector2f& down) {
  const Vector2f one = across + down, other = across - down;
  return camera.in_silhouette(middle + one) && camera.in_silhouette(middle - one) &&
         camera.in_silhouette(middle + other) && camera.in_silhouette(middle - other);
}

}  // namespace

WindowViews views_of(const TemplateWindow& window, std::span<const SurfaceCamera> cameras,
                     std::span<const DepthBuffer> depths, const WindowChoice& choice,
                     const CorrelationOptions& correlation) {
  const Vector3f across = window.spacing_m * axis_across(window.normal);
  const Vector3f down = window.normal.cross(across);
  const Vector3f out = window.step_m * window.normal;
  WindowViews views;
  const Candidates candidates = those_that_see(window, cameras, depths, choice);
  for (const Candidate& candidate : candidates.all()) {
    const SurfaceCamera& camera = cameras[candidate.camera];
    const Vector2f& seen = candidate.seen.pixel;
    const Luminance& picture = camera.picture(choice.level);
    const Vector2f middle = seen * picture.scale();
    const auto beside = [&](const Vector3f& way) -> Vector2f {
      const auto at = camera.project(window.place + way);
      return at ? Vector2f(at->pixel * picture.scale() - middle)
                : Vector2f::Constant(std::numeric_limits<float>::quiet_NaN());
    };
    const Vector2f a = beside(across), d = beside(down), o = beside(out);
    const WindowView view{&picture,
                          middle.x() - picture.first_u(),
                          middle.y() - picture.first_v(),
                          a.x(),
                          a.y(),
                          d.x(),
                          d.y(),
                          o.x(),
                          o.y()};
    if (!window_fits(view, correlation)) continue;
    const int samples_to_side = correlation.side / 2;
    const float reach = static_cast<float>(samples_to_side) / picture.scale();
    if (views.count == 0 && !corners_in_silhouette(camera, seen, reach * a, reach * d)) return {};
    views.camera[views.count] = static_cast<uint32_t>(candidate.camera);
    views.view[views.count++] = view;
  }
  return views;
}

}  // namespace v3d
