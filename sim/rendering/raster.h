// Z-buffer rasteriser: the nearest triangle at each pixel of a camera.
#pragma once

#include <Eigen/Core>
#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "base/geometry/camera_model.h"

namespace v3d::sim {

using Triangle = std::array<uint32_t, 3>;

/// A projected vertex. Triangles with a vertex that is not `seen` are not drawn.
struct ScreenPoint {
  float x = 0, y = 0;       ///< pixels, CameraModel's convention
  float inverse_depth = 0;  ///< 1 / z in the camera frame, per metre
  bool seen = false;        ///< in front of the camera and in the valid range of the lens model
};

/// Projects vertices with the full lens model. Edges stay straight, so triangles must be small.
std::vector<ScreenPoint> to_screen(const CameraModel& camera,
                                   std::span<const Eigen::Vector3f> points);

/// The bounding rectangle of all seen points, clipped to the image.
Rect screen_bounds(std::span<const ScreenPoint> points, ImageSize size);

class DepthBuffer {
 public:
  static constexpr uint32_t kNothing = 0xFFFFFFFF;

  /// Clears the buffer and sets its area.
  void clear(Rect area);
  /// Draws the front-facing triangles, at pixels whose centres they contain. Triangles are numbered
  /// from `first`.
  void draw(std::span<const ScreenPoint> points, std::span<const Triangle> triangles,
            uint32_t first = 0);

  Rect area() const { return area_; }
  /// The nearest triangle at a pixel of area(), or kNothing.
  uint32_t triangle(int x, int y) const { return triangle_[index(x, y)]; }
  float inverse_depth(int x, int y) const { return inverse_depth_[index(x, y)]; }

 private:
  size_t index(int x, int y) const {
    return static_cast<size_t>(y - area_.y0) * area_.width + (x - area_.x0);
  }

  Rect area_;
  std::vector<float> inverse_depth_;
  std::vector<uint32_t> triangle_;
};

/// Perspective-correct barycentric coordinates of a pixel inside a triangle; their sum is 1.
Eigen::Vector3f weights_at(const ScreenPoint& a, const ScreenPoint& b, const ScreenPoint& c, int x,
                           int y);

}  // namespace v3d::sim
