#include <algorithm>
#include <cmath>

#include "sim/rendering/camera_images.h"

namespace v3d::sim {

std::vector<ScreenPoint> to_screen(const CameraModel& camera,
                                   std::span<const Eigen::Vector3f> points) {
  std::vector<ScreenPoint> screen(points.size());
  const Eigen::Vector3d axis = camera.cam_from_world().rotation.row(2).transpose();
  const double offset = camera.cam_from_world().translation.z();
  for (size_t i = 0; i < points.size(); ++i) {
    const Eigen::Vector3d world = points[i].cast<double>();
    if (const auto pixel = camera.project(world)) {
      screen[i] = {static_cast<float>(pixel->x()), static_cast<float>(pixel->y()),
                   static_cast<float>(1 / (axis.dot(world) + offset)), true};
    }
  }
  return screen;
}

Rect screen_bounds(std::span<const ScreenPoint> points, ImageSize size) {
  float x0 = static_cast<float>(size.width), y0 = static_cast<float>(size.height), x1 = -1, y1 = -1;
  for (const ScreenPoint& p : points) {
    if (p.seen) {
      x0 = std::min(x0, p.x);
      y0 = std::min(y0, p.y);
      x1 = std::max(x1, p.x);
      y1 = std::max(y1, p.y);
    }
  }
  const auto low = [](float v) {
    return std::max(0, static_cast<int>(std::floor(std::max(v, -1.0F))));
  };
  const auto high = [](float v, int side) {
    return static_cast<int>(std::ceil(std::min(v, static_cast<float>(side - 1)))) + 1;
  };
  const Rect r{low(x0), low(y0), std::min(size.width, high(x1, size.width)) - low(x0),
               std::min(size.height, high(y1, size.height)) - low(y0)};
  return r.empty() ? Rect{} : r;
}

void VisibilityBuffer::clear(Rect area) {
  area_ = area;
  const size_t pixels = static_cast<size_t>(area.width) * static_cast<size_t>(area.height);
  inverse_depth_.assign(pixels, 0.0F);
  triangle_.assign(pixels, kNothing);
}

void VisibilityBuffer::draw(std::span<const ScreenPoint> points,
                            std::span<const Triangle> triangles, uint32_t first) {
  const int last_x = area_.x0 + area_.width - 1;
  const int last_y = area_.y0 + area_.height - 1;
  for (size_t t = 0; t < triangles.size(); ++t) {
    const ScreenPoint& a = points[triangles[t][0]];
    const ScreenPoint& b = points[triangles[t][1]];
    const ScreenPoint& c = points[triangles[t][2]];
    if (!a.seen || !b.seen || !c.seen) {
      continue;
    }
    // Image y points down, so front-facing triangles have a negative area on the screen.
    const float twice_area = (b.x - a.x) * (c.y - a.y) - (c.x - a.x) * (b.y - a.y);
    if (twice_area >= 0) {
      continue;
    }
    const auto [left, right] = std::minmax({a.x, b.x, c.x});
    const auto [top, bottom] = std::minmax({a.y, b.y, c.y});
    if (right < static_cast<float>(area_.x0) || left > static_cast<float>(last_x) ||
        bottom < static_cast<float>(area_.y0) || top > static_cast<float>(last_y)) {
      continue;
    }
    const int x0 = std::max(area_.x0, static_cast<int>(std::ceil(left)));
    const int x1 = std::min(last_x, static_cast<int>(std::floor(right)));
    const int y0 = std::max(area_.y0, static_cast<int>(std::ceil(top)));
    const int y1 = std::min(last_y, static_cast<int>(std::floor(bottom)));
    const float scale = 1 / twice_area;
    const float wb_x = (c.y - a.y) * scale, wb_y = -(c.x - a.x) * scale;
    const float wc_x = -(b.y - a.y) * scale, wc_y = (b.x - a.x) * scale;
    for (int y = y0; y <= y1; ++y) {
      const float dy = static_cast<float>(y) - a.y;
      size_t i = index(x0, y);
      for (int x = x0; x <= x1; ++x, ++i) {
        const float dx = static_cast<float>(x) - a.x;
        const float wb = dx * wb_x + dy * wb_y;
        const float wc = dx * wc_x + dy * wc_y;
        const float wa = 1 - wb - wc;
        if (wa < 0 || wb < 0 || wc < 0) {
          continue;
        }
        const float near = wa * a.inverse_depth + wb * b.inverse_depth + wc * c.inverse_depth;
        if (near > inverse_depth_[i]) {
          inverse_depth_[i] = near;
          triangle_[i] = first + static_cast<uint32_t>(t);
        }
      }
    }
  }
}

Eigen::Vector3f weights_at(const ScreenPoint& a, const ScreenPoint& b, const ScreenPoint& c, int x,
                           int y) {
  const float scale = 1 / ((b.x - a.x) * (c.y - a.y) - (c.x - a.x) * (b.y - a.y));
  const float dx = static_cast<float>(x) - a.x;
  const float dy = static_cast<float>(y) - a.y;
  const float wb = (dx * (c.y - a.y) - dy * (c.x - a.x)) * scale;
  const float wc = (dy * (b.x - a.x) - dx * (b.y - a.y)) * scale;
  Eigen::Vector3f w((1 - wb - wc) * a.inverse_depth, wb * b.inverse_depth, wc * c.inverse_depth);
  return w / w.sum();
}

}  // namespace v3d::sim
