// Projection and rasterisation of triangles.
#pragma once

#include <algorithm>
#include <array>
#include <cstdint>
#include <utility>
#include <vector>

#include "base/geometry/camera_model.h"
#include "base/geometry/mesh.h"

namespace v3d::recon {

// Projection of the vertices of a mesh into a camera.

/// Distance of the near plane, metres. Nothing nearer is drawn, so that a mesh around a camera does
/// no harm.
inline constexpr double kNearPlaneMetres = 0.05;

/// x and y are pixels with (0, 0) in the centre of the first pixel, also outside the image.
struct ScreenVertex {
  float x = 0, y = 0;
  float z = 0;          ///< along the optical axis, metres; valid also where !on_screen()
  float inverse_z = 0;  ///< 1 / z where on_screen(), else 0

  /// In front of the near plane and inside the lens model: x and y are valid.
  bool on_screen() const { return inverse_z > 0; }
};

/// Projects every vertex through the whole lens model in single precision, within 0.02 pixels of
/// CameraModel::project() from 0.2 m on. In the order of the mesh. One thread; every instruction
/// set gives the same bits. `screen` keeps its memory.
void project_vertices(const Mesh& mesh, const CameraModel& camera,
                      std::vector<ScreenVertex>& screen);
std::vector<ScreenVertex> project_vertices(const Mesh& mesh, const CameraModel& camera);

// Triangle rasterisation: clipping at the near plane, and the rows of pixels that a triangle
// covers. Shared by depth buffer, silhouette and renderer.

/// A clipped piece of a triangle. `weights` are barycentric in the whole triangle, for
/// interpolation.
struct ScreenTriangle {
  std::array<ScreenVertex, 3> corner;
  std::array<Eigen::Vector3f, 3> weights;
};

/// Clips triangle `t` at the near plane to 0, 1 or 2 pieces. A piece with a corner beyond
/// CameraModel::max_radius2() is left out, because it lies outside the field of view. `pieces`
/// keeps its memory.
void clip_to_near_plane(const Mesh& mesh, uint32_t t, const CameraModel& camera,
                        const std::vector<ScreenVertex>& vertices,
                        std::vector<ScreenTriangle>& pieces);

/// Calls draw(t, piece) for all triangles in the order of the mesh, clipped where necessary.
template <class Draw>
void for_each_screen_triangle(const Mesh& mesh, const CameraModel& camera,
                              const std::vector<ScreenVertex>& vertices, Draw&& draw) {
  std::vector<ScreenTriangle> pieces;
  for (uint32_t t = 0; t < mesh.triangles.size(); ++t) {
    const auto& [a, b, c] = mesh.triangles[t];
    if (vertices[a].on_screen() && vertices[b].on_screen() && vertices[c].on_screen()) {
      draw(t, ScreenTriangle{
                  {vertices[a], vertices[b], vertices[c]},
                  {Eigen::Vector3f::UnitX(), Eigen::Vector3f::UnitY(), Eigen::Vector3f::UnitZ()}});
      continue;
    }
    clip_to_near_plane(mesh, t, camera, vertices, pieces);
    for (const ScreenTriangle& piece : pieces) {
      draw(t, piece);
    }
  }
}

/// Coverage is decided exactly, in integers: corners are rounded to a lattice of 1/256 pixel.
/// Coordinates are clamped to kMaxPixels, so that all products fit into 64 bits.
inline constexpr int kFixedBits = 8;
inline constexpr int kFixedOne = 1 << kFixedBits;
inline constexpr float kMaxPixels = 1 << 22;

inline int32_t to_fixed(float pixels) {
  constexpr double kRound = 6755399441055744.0;  // 1.5 * 2^52: its last digit is worth 1
  const float kept = std::min(std::max(-kMaxPixels, pixels), kMaxPixels);
  return static_cast<int32_t>(double{kept * kFixedOne} + kRound - kRound);
}

/// The first pixel whose centre is at or after the coordinate.
inline int first_pixel(int32_t fixed) { return (fixed + kFixedOne - 1) >> kFixedBits; }

/// A corner of a triangle in 1/256 pixels.
struct FixedPoint {
  int32_t x = 0, y = 0;
  FixedPoint() = default;
  explicit FixedPoint(const ScreenVertex& v) : x(to_fixed(v.x)), y(to_fixed(v.y)) {}
  friend bool operator<(const FixedPoint& p, const FixedPoint& q) {
    return p.y < q.y || (p.y == q.y && p.x < q.x);
  }
};

/// The first pixel of row y whose centre is at or after the edge p-q. Requires p.y < q.y.
inline int64_t first_pixel_after(const FixedPoint& p, const FixedPoint& q, int y) {
  const int64_t dx = int64_t{q.x} - p.x, dy = int64_t{q.y} - p.y;
  const int64_t top = p.x * dy + dx * (int64_t{y} * kFixedOne - p.y);
  const int64_t bottom = dy * kFixedOne;
  const int64_t quotient = top / bottom;  // towards zero
  return quotient + (top % bottom > 0);
}

/// The part of an image that is drawn: columns 0 <= x < width, rows row_begin <= y < row_end.
struct Band {
  int width = 0;
  int row_begin = 0;
  int row_end = 0;
};

/// Calls emit(y, x_begin, x_end) for the pixels of the band whose centres the triangle covers. A
/// centre on an edge belongs to the triangle on the right of or below the edge. So triangles with a
/// common edge leave no gap and draw no pixel twice. Either orientation.
template <class Emit>
void for_each_span(const std::array<ScreenVertex, 3>& corner, Band band, Emit&& emit) {
  std::array<FixedPoint, 3> p{FixedPoint(corner[0]), FixedPoint(corner[1]), FixedPoint(corner[2])};
  std::sort(p.begin(), p.end());
  const auto& [a, b, c] = p;
  const int y_end = std::min(first_pixel(c.y), band.row_end);
  for (int y = std::max(first_pixel(a.y), band.row_begin); y < y_end; ++y) {
    const int64_t x_long = first_pixel_after(a, c, y);
    const bool upper = y * int64_t{kFixedOne} < b.y;
    const int64_t x_short = upper ? first_pixel_after(a, b, y) : first_pixel_after(b, c, y);
    const auto inside = [&](int64_t x) {
      return static_cast<int>(std::clamp<int64_t>(x, 0, band.width));
    };
    const int x_begin = inside(std::min(x_long, x_short));
    const int x_end = inside(std::max(x_long, x_short));
    if (x_begin < x_end) {
      emit(y, x_begin, x_end);
    }
  }
}

/// A linear function of the image: value(x, y) = at_origin + dx * x + dy * y. For a degenerate
/// triangle, the value of its first corner.
struct ScreenPlane {
  double at_origin = 0, dx = 0, dy = 0;
  ScreenPlane() = default;
  ScreenPlane(const std::array<ScreenVertex, 3>& corner, const std::array<double, 3>& value);
  double operator()(double x, double y) const { return at_origin + dx * x + dy * y; }
};

}  // namespace v3d::recon
