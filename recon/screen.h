// Triangles on their way to the screen: projection, the near plane, and the rows of pixels that a
// triangle covers. Shared by the depth buffer, the silhouette and the renderer.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <utility>
#include <vector>

#include "base/camera_model.h"
#include "base/mesh.h"

namespace v3d {

/// Nothing nearer than this to a camera is drawn: a mesh round a camera does no harm.
inline constexpr double kNearPlaneMetres = 0.05;

/// A vertex as a camera sees it. x and y are pixels (centre of the first pixel: 0, 0), also outside
/// the image.
struct ScreenVertex {
  float x = 0, y = 0;
  float z = 0;             ///< along the optical axis, metres; right also where !on_screen
  bool on_screen = false;  ///< in front of the near plane and inside the lens model: x, y are right
};

/// The whole lens model at every vertex, in single precision: within 0.02 pixels of
/// CameraModel::project() from 0.2 m before the camera. In the order of the mesh; one thread.
std::vector<ScreenVertex> project_vertices(const Mesh& mesh, const CameraModel& camera);

/// The same vertices on the image of camera.reduced(factor).
void reduce(std::vector<ScreenVertex>& vertices, int factor);

/// A piece of a triangle in front of the near plane. `weights` are barycentric in the whole
/// triangle, for what is interpolated across it.
struct ScreenTriangle {
  std::array<ScreenVertex, 3> corner;
  std::array<Eigen::Vector3f, 3> weights;
};

/// Cuts triangle `t` at the near plane: 0, 1 or 2 pieces. A piece with a corner that the lens model
/// cannot place (beyond CameraModel::max_radius2()) is left out: it lies outside the field of view.
/// `factor`: that of reduce(). `pieces` keeps its memory.
void clip_to_near_plane(const Mesh& mesh, uint32_t t, const CameraModel& camera,
                        const std::vector<ScreenVertex>& vertices, int factor,
                        std::vector<ScreenTriangle>& pieces);

/// Calls draw(piece) for all triangles in the order of the mesh, cut at the near plane where they
/// must be.
template <class Draw>
void for_each_screen_triangle(const Mesh& mesh, const CameraModel& camera,
                              const std::vector<ScreenVertex>& vertices, int factor, Draw&& draw) {
  std::vector<ScreenTriangle> pieces;
  for (uint32_t t = 0; t < mesh.triangles.size(); ++t) {
    const auto& [a, b, c] = mesh.triangles[t];
    if (vertices[a].on_screen && vertices[b].on_screen && vertices[c].on_screen) {
      draw(t, ScreenTriangle{
                  {vertices[a], vertices[b], vertices[c]},
                  {Eigen::Vector3f::UnitX(), Eigen::Vector3f::UnitY(), Eigen::Vector3f::UnitZ()}});
      continue;
    }
    clip_to_near_plane(mesh, t, camera, vertices, factor, pieces);
    for (const ScreenTriangle& piece : pieces) {
      draw(t, piece);
    }
  }
}

/// Where the edge p-q crosses row y. Callers pass the ends in the order of (y, x), so that two
/// triangles find the same number for the edge they share.
inline double crossing(const ScreenVertex& p, const ScreenVertex& q, double y) {
  return p.x + (double{q.x} - p.x) * ((y - p.y) / (double{q.y} - p.y));
}

/// The part of an image that is drawn: columns 0 <= x < width, rows row_begin <= y < row_end.
struct Band {
  int width = 0;
  int row_begin = 0;
  int row_end = 0;
};

/// The first whole number at or above `v`, kept in [low, high]. Requires 0 <= low. (std::ceil is a
/// call on a plain x86-64, and most triangles cover less than a pixel.)
inline int first_at(double v, int low, int high) {
  if (!(v > low)) {
    return low;
  }
  if (v >= high) {
    return high;
  }
  const int whole = static_cast<int>(v);
  return whole + (whole < v);
}

/// True for most of the triangles that cover no pixel centre of the band, for little work.
inline bool surely_misses(const std::array<ScreenVertex, 3>& corner, Band band) {
  const auto [x_low, x_high] = std::minmax({corner[0].x, corner[1].x, corner[2].x});
  const auto [y_low, y_high] = std::minmax({corner[0].y, corner[1].y, corner[2].y});
  return first_at(x_low, 0, band.width) == first_at(x_high, 0, band.width) ||
         first_at(y_low, band.row_begin, band.row_end) ==
             first_at(y_high, band.row_begin, band.row_end);
}

/// Calls emit(y, x_begin, x_end) for the pixels of the band whose centres the triangle covers. A
/// centre on an edge belongs to the triangle on its right or below: triangles that share an edge
/// leave no gap and draw no pixel twice. Either orientation.
template <class Emit>
void for_each_span(const std::array<ScreenVertex, 3>& corner, Band band, Emit&& emit) {
  const ScreenVertex* a = &corner[0];
  const ScreenVertex* b = &corner[1];
  const ScreenVertex* c = &corner[2];
  const auto sort = [](const ScreenVertex*& p, const ScreenVertex*& q) {
    if (q->y < p->y || (q->y == p->y && q->x < p->x)) {
      std::swap(p, q);
    }
  };
  sort(a, b);
  sort(b, c);
  sort(a, b);
  const int y_end = first_at(c->y, band.row_begin, band.row_end);
  for (int y = first_at(a->y, band.row_begin, band.row_end); y < y_end; ++y) {
    const double x_long = crossing(*a, *c, y);
    const double x_short = y < b->y ? crossing(*a, *b, y) : crossing(*b, *c, y);
    const int x_begin = first_at(std::min(x_long, x_short), 0, band.width);
    const int x_end = first_at(std::max(x_long, x_short), 0, band.width);
    if (x_begin < x_end) {
      emit(y, x_begin, x_end);
    }
  }
}

/// A number that changes evenly across the image: value(x, y) = at_origin + dx * x + dy * y.
/// Deterministic; for degenerate triangles the value is that of the first corner.
struct ScreenPlane {
  double at_origin = 0, dx = 0, dy = 0;
  ScreenPlane() = default;
  ScreenPlane(const std::array<ScreenVertex, 3>& corner, const std::array<double, 3>& value);
  double operator()(double x, double y) const { return at_origin + dx * x + dy * y; }
};

}  // namespace v3d
