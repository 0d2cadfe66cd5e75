#include "recon/surface/template_windows.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>

namespace v3d {
namespace {

using Eigen::Vector2f;
using Eigen::Vector3f;

/// An arbitrary axis of the window in the tangent plane.
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

void WindowBlock::find(std::span<const Vector3f> places, std::span<const Vector3f> normals,
                       std::span<const SurfaceCamera> cameras,
                       std::span<const VertexVisibility> visibilities, const WindowOptions& options,
                       const CorrelationOptions& correlation) {
  const int max_views = std::min(options.max_views, kMaxWindowViews);
  for (size_t i = 0; i < places.size(); ++i) {
    candidates_[i].count = 0;
    if (i % options.every == 0) choose_cameras(i, visibilities, max_views);
  }
  list_observers(normals.first(places.size()), options, cameras.size());
  for (size_t c = 0; c < cameras.size(); ++c) {
    project_axes(places, normals, cameras[c], observers_[c], options);
  }
  for (size_t i = 0; i < places.size(); ++i)
    make_views(i, cameras, visibilities, options, correlation);
}

void WindowBlock::choose_cameras(size_t i, std::span<const VertexVisibility> visibilities,
                                 int max_views) {
  auto& [count, list] = candidates_[i];
  for (uint32_t c = 0; c < visibilities.size(); ++c) {
    const float facing = visibilities[c].seen[i];
    if (facing < 0 || (count == max_views && !(facing > list[count - 1].facing))) continue;
    int k = count < max_views ? count++ : count - 1;
    for (; k > 0 && list[k - 1].facing < facing; --k) list[k] = list[k - 1];
    list[k].facing = facing;
    list[k].camera = c;
  }
}

/// Lists the windows by camera.
void WindowBlock::list_observers(std::span<const Vector3f> normals, const WindowOptions& options,
                                 size_t cameras) {
  observers_.resize(cameras);
  for (std::vector<Observer>& observers : observers_) observers.clear();
  for (size_t i = 0; i < normals.size(); ++i) {
    auto& [count, list] = candidates_[i];
    if (count > 0) across_[i] = options.spacing_m * axis_across(normals[i]);
    for (int k = 0; k < count; ++k) observers_[list[k].camera].push_back({i, &list[k]});
  }
}

/// Projects, for all windows that the camera sees, the ends of one step along each window axis and
/// along the normal.
void WindowBlock::project_axes(std::span<const Vector3f> places, std::span<const Vector3f> normals,
                               const SurfaceCamera& camera, std::span<const Observer> observers,
                               const WindowOptions& options) {
  PointBlock points;
  PixelBlock pixels;
  static_assert(3 * VertexVisibility::kCapacity <= PointBlock::kCapacity);
  for (const auto& [i, candidate] : observers) {
    points.set(points.count++, places[i] + across_[i]);
    points.set(points.count++, places[i] + normals[i].cross(across_[i]));
    points.set(points.count++, places[i] + options.step_m * normals[i]);
  }
  project_block(camera, points, pixels);
  size_t at = 0;
  const auto next_pixel = [&] {
    const Vector2f pixel(pixels.u[at], pixels.v[at]);
    ++at;
    return pixel;
  };
  for (const auto& [i, candidate] : observers) {
    candidate->across = next_pixel();
    candidate->down = next_pixel();
    candidate->out = next_pixel();
  }
}

void WindowBlock::make_views(size_t i, std::span<const SurfaceCamera> cameras,
                             std::span<const VertexVisibility> visibilities,
                             const WindowOptions& options, const CorrelationOptions& correlation) {
  WindowViews& views = views_[i];
  views.count = 0;
  for (int k = 0; k < candidates_[i].count; ++k) {
    const Candidate& candidate = candidates_[i].list[k];
    const SurfaceCamera& camera = cameras[candidate.camera];
    const Luminance& picture = camera.picture(options.level);
    const Vector2f seen = visibilities[candidate.camera].at(i).pixel,
                   middle = seen * picture.scale();
    const Vector2f a = candidate.across * picture.scale() - middle;
    const Vector2f d = candidate.down * picture.scale() - middle;
    const Vector2f o = candidate.out * picture.scale() - middle;
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
    if (views.count == 0 && !corners_in_silhouette(camera, seen, reach * a, reach * d)) return;
    views.camera[views.count] = candidate.camera;
    views.view[views.count++] = view;
  }
}

}  // namespace v3d
