#include "recon/visibility/point_depth_buffer.h"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "recon/visibility/point_depth_buffer.cc"
#include <hwy/foreach_target.h>  // compiles this file once per instruction set
#include <hwy/highway.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <limits>

#include "recon/render/rasteriser.h"

HWY_BEFORE_NAMESPACE();
namespace v3d::recon::HWY_NAMESPACE {
namespace {

namespace hn = hwy::HWY_NAMESPACE;

#include "recon/hull/voxel_projection_steps.inc"
#include "recon/simd_float.inc"

static_assert(PointArrays::kBlock % kMaxLanes == 0);

HWY_INLINE Lanes load(const std::vector<float>& array, size_t i) {
  return Lanes(hn::LoadU(Floats(), array.data() + i));
}

/// Locates one register of points.
template <Lens kLens>
HWY_INLINE void locate(const VoxelCamera& lens, const CellGrid& grid, const PointArrays& points,
                       size_t from, size_t to, LocatedPoints& located) {
  const Floats floats;
  const Ints ints;
  const auto limit = [&](auto bound) { return hn::Set(floats, static_cast<float>(bound)); };
  const CameraPoint<Lanes> p = HWY_NAMESPACE::camera_point<Lanes>(
      lens, load(points.x, from), load(points.y, from), load(points.z, from));
  const PixelPoint<Lanes> q = HWY_NAMESPACE::pixel_point<kLens, Lanes>(lens, p);
  const Lanes column = (q.u - grid.first_u) * grid.cells_per_pixel;
  const Lanes row = (q.v - grid.first_v) * grid.cells_per_pixel;
  const auto seen =
      hn::And(hn::Ge(p.z.v, limit(kNearPlaneMetres)), hn::Le(q.radius2.v, limit(lens.max_radius2)));
  const auto in_columns =
      hn::And(hn::Ge(column.v, limit(0)), hn::Lt(column.v, limit(grid.columns)));
  const auto in_rows = hn::And(hn::Ge(row.v, limit(0)), hn::Lt(row.v, limit(grid.rows)));
  const auto in_cell = hn::And(seen, hn::And(in_columns, in_rows));
  const auto near = hn::And(seen, hn::Lt(p.z.v, limit(grid.whole_from_z)));

  const auto x = hn::ConvertTo(ints, hn::IfThenElseZero(in_cell, column.v));
  const auto y = hn::ConvertTo(ints, hn::IfThenElseZero(in_cell, row.v));
  auto cell = hn::Add(hn::Mul(y, hn::Set(ints, grid.columns)), x);
  cell = hn::IfThenElse(hn::RebindMask(ints, in_cell), cell, hn::Set(ints, grid.count()));
  cell = hn::IfThenElse(hn::RebindMask(ints, near), hn::Set(ints, LocatedPoints::kNear), cell);
  hn::Store(cell, ints, located.cell.data() + to);
  hn::Store(column.v, floats, located.column.data() + to);
  hn::Store(row.v, floats, located.row.data() + to);
  hn::Store(p.z.v, floats, located.z.data() + to);
}

template <Lens kLens>
void locate_block(const VoxelCamera& lens, const CellGrid& grid, const PointArrays& points,
                  size_t first, LocatedPoints& located) {
  for (size_t i = 0; i < PointArrays::kBlock; i += hn::Lanes(Floats())) {
    locate<kLens>(lens, grid, points, first + i, i, located);
  }
}

void locate_any(const VoxelCamera& lens, const CellGrid& grid, const PointArrays& points,
                size_t first, LocatedPoints& located) {
  switch (lens.lens) {
    case Lens::kPinhole:
      return locate_block<Lens::kPinhole>(lens, grid, points, first, located);
    case Lens::kPolynomial:
      return locate_block<Lens::kPolynomial>(lens, grid, points, first, located);
    default:
      return locate_block<Lens::kFull>(lens, grid, points, first, located);
  }
}

}  // namespace
}  // namespace v3d::recon::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace v3d::recon {

HWY_EXPORT(locate_any);

void locate_points(const VoxelCamera& lens, const CellGrid& grid, const PointArrays& points,
                   size_t first, LocatedPoints& located) {
  HWY_DYNAMIC_DISPATCH(locate_any)(lens, grid, points, first, located);
}

namespace {

constexpr float kNothing = std::numeric_limits<float>::infinity();

/// Cells are sized for points at this part of the centroid's distance. Nearer points cover more
/// cells.
constexpr double kNearPart = 0.8;

/// Smallest width of a cell, pixels. Smaller cells cost more and add no detail.
constexpr double kMinPixels = 1;

/// Number of cells in each direction that a point covers. With 2, occluders have finer edges (0.015
/// dB better in a held-out camera), but the buffer needs four times the cells.
constexpr int kSpread = 1;

/// Largest number of pixels per metre across the view, at a distance of 1 m along the axis. Away
/// from the axis, a camera without distortion enlarges lengths by up to sqrt(1 + x^2 + y^2).
double max_pixels(const CameraModel& camera, Rect roi) {
  const Eigen::Matrix3d& k = camera.matrix();
  const double focal = std::max(k(0, 0), k(1, 1));
  const double across = std::max(k(0, 2) - roi.x0, roi.x0 + roi.width - k(0, 2));
  const double down = std::max(k(1, 2) - roi.y0, roi.y0 + roi.height - k(1, 2));
  return focal * std::hypot(1, across / focal, down / focal);
}

CellGrid cells_over(Rect roi, double cell_pixels, double whole_from_z) {
  constexpr double kRings = kSpread + 0.25;
  CellGrid grid;
  grid.cells_per_pixel = static_cast<float>(1 / cell_pixels);
  // The rings are a quarter of a cell wider, so that rounding never puts a pixel of the roi into
  // them.
  grid.first_u = static_cast<float>(roi.x0 - kRings * cell_pixels);
  grid.first_v = static_cast<float>(roi.y0 - kRings * cell_pixels);
  grid.columns = static_cast<int>(std::ceil(roi.width / cell_pixels)) + 2 * kSpread + 1;
  grid.rows = static_cast<int>(std::ceil(roi.height / cell_pixels)) + 2 * kSpread + 1;
  grid.whole_from_z = static_cast<float>(whole_from_z);
  return grid;
}

float nearer(float a, float b) { return a < b ? a : b; }

}  // namespace

PointDepthBuffer::PointDepthBuffer(const PointArrays& points, const Eigen::Vector3f& centroid,
                                   double radius_m, const CameraModel& camera,
                                   const VoxelCamera& lens, Rect roi) {
  const double z = (camera.cam_from_world() * centroid.cast<double>()).z();
  const double pixels = radius_m * max_pixels(camera, roi) / kSpread;  // seen from 1 m
  const double from_z = std::max({kNearPart * z, kNearPlaneMetres, pixels / roi.width});
  const double cell_pixels = std::max(kMinPixels, pixels / from_z);
  grid_ = cells_over(roi, cell_pixels, pixels / cell_pixels);
  nearest_.assign(static_cast<size_t>(grid_.count()) + 1, kNothing);
  draw(points, lens);
  nearest_.pop_back();
  spread_to_neighbours();
}

void PointDepthBuffer::draw(const PointArrays& points, const VoxelCamera& lens) {
  LocatedPoints located;
  for (size_t block = 0; block < points.blocks(); ++block) {
    locate_points(lens, grid_, points, block * PointArrays::kBlock, located);
    for (size_t i = 0; i < PointArrays::kBlock; ++i) {
      const int32_t cell = located.cell[i];
      if (cell == LocatedPoints::kNear) {
        draw_near(located.column[i], located.row[i], located.z[i]);
      } else {
        nearest_[cell] = nearer(located.z[i], nearest_[cell]);
      }
    }
  }
}

/// Draws a point that is so near that its neighbours may be several cells away.
void PointDepthBuffer::draw_near(float column, float row, float z) {
  const float reach = std::ceil(kSpread * (grid_.whole_from_z / z)) - kSpread;
  const auto bound = [](float at, int count) {
    return static_cast<int>(std::clamp(at, 0.0F, static_cast<float>(count)));
  };
  const int x_end = bound(column + reach + 1, grid_.columns);
  const int y_end = bound(row + reach + 1, grid_.rows);
  for (int y = bound(row - reach, grid_.rows); y < y_end; ++y) {
    for (int x = bound(column - reach, grid_.columns); x < x_end; ++x) {
      float& nearest = nearest_[static_cast<size_t>(y) * grid_.columns + x];
      nearest = nearer(z, nearest);
    }
  }
}

/// Spreads along the columns, then along the rows, one row at a time, so that the intermediate row
/// stays in the cache.
void PointDepthBuffer::spread_to_neighbours() {
  static_assert(kSpread == 1);
  const auto columns = static_cast<size_t>(grid_.columns);
  std::vector<float> above(columns, kNothing), down(columns + 2, kNothing);
  for (int y = 0; y < grid_.rows; ++y) {
    float* row = nearest_.data() + static_cast<size_t>(y) * columns;
    const float* below = y + 1 < grid_.rows ? row + columns : row;
    for (size_t x = 0; x < columns; ++x) {
      down[x + 1] = nearer(row[x], nearer(above[x], below[x]));
      above[x] = row[x];
    }
    for (size_t x = 0; x < columns; ++x) {
      row[x] = nearer(down[x + 1], nearer(down[x], down[x + 2]));
    }
  }
}

namespace {

using Corners = std::array<Eigen::Vector3f, 3>;

/// Squared covering radius: the largest distance of a point in the triangle from the nearest
/// corner. It is half the longest edge in obtuse triangles, else the circumradius.
float covering_radius2(const Corners& c) {
  const Eigen::Vector3f ab = c[1] - c[0], ac = c[2] - c[0];
  std::array<float, 3> edge2{ab.squaredNorm(), ac.squaredNorm(), (ac - ab).squaredNorm()};
  std::sort(edge2.begin(), edge2.end());
  const float area2 = ab.cross(ac).squaredNorm();  // of the parallelogram
  const bool obtuse = edge2[0] + edge2[1] <= edge2[2];
  return obtuse || area2 == 0 ? edge2[2] / 4 : edge2[0] * edge2[1] * edge2[2] / (4 * area2);
}

/// A cheap sufficient test: true only when the covering radius is at most `radius`. True for most
/// triangles.
bool surely_small(const Corners& c, float radius2) {
  const float longest2 = std::max(
      {(c[1] - c[0]).squaredNorm(), (c[2] - c[0]).squaredNorm(), (c[2] - c[1]).squaredNorm()});
  return longest2 <= 3 * radius2;
}

/// The corners of the n * n similar triangles into which a triangle is divided, without its own
/// corners.
void add_lattice(const Corners& c, int n, std::vector<Eigen::Vector3f>& points) {
  const Eigen::Vector3f ab = (c[1] - c[0]) / static_cast<float>(n);
  const Eigen::Vector3f ac = (c[2] - c[0]) / static_cast<float>(n);
  for (int i = 0; i <= n; ++i) {
    for (int j = 0; i + j <= n; ++j) {
      const bool corner = i == n || j == n || (i == 0 && j == 0);
      if (!corner) {
        points.push_back(c[0] + static_cast<float>(i) * ab + static_cast<float>(j) * ac);
      }
    }
  }
}

}  // namespace

std::vector<Eigen::Vector3f> occluding_points(const Mesh& mesh, double radius_m, size_t max_added) {
  constexpr double kMaxParts = 1024;
  std::vector<Eigen::Vector3f> points = mesh.vertices;
  const auto radius2 = static_cast<float>(radius_m * radius_m);
  for (const auto& t : mesh.triangles) {
    const Corners corners{mesh.vertices[t[0]], mesh.vertices[t[1]], mesh.vertices[t[2]]};
    if (surely_small(corners, radius2)) {
      continue;
    }
    const float cover2 = covering_radius2(corners);
    if (cover2 > radius2) {
      if (points.size() - mesh.vertices.size() >= max_added) break;
      const double parts = std::ceil(std::sqrt(cover2) / radius_m);  // infinite for a radius of 0
      add_lattice(corners, static_cast<int>(std::min(parts, kMaxParts)), points);
    }
  }
  return points;
}

}  // namespace v3d::recon
#endif
