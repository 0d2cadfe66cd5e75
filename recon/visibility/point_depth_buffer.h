// Points of a surface and their depth buffer.
#pragma once

#include <Eigen/Core>
#include <array>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <vector>

#include "base/geometry/camera_model.h"
#include "base/geometry/mesh.h"
#include "recon/hull/voxel_grid.h"

namespace v3d::recon {

// Points of a surface: coordinates laid out for SIMD, and a set of points that covers the surface.

/// The vertices of `mesh`, and points inside its larger triangles, so that every point of the
/// surface is within `radius_m` metres of one of the result.
///
/// Triangles no larger than the radius need no point: for marching cubes, voxels with edges of 1.41
/// * radius_m. A triangle n times as large adds about n^2 / 2 points.
///
/// A mesh from outside may have one triangle that is 100,000 times as large as the others. So n is
/// at most 1024, and no triangle adds points after `max_added` were added. The points of such a
/// mesh have gaps.
std::vector<Eigen::Vector3f> occluding_points(const Mesh& mesh, double radius_m,
                                              size_t max_added = size_t{1} << 24);

/// Coordinates of points or vectors, one array each, padded with NaN to a multiple of kBlock. NaN
/// projects to no pixel.
struct PointArrays {
  static constexpr size_t kBlock = 512;

  size_t count = 0;  ///< without the padding
  std::vector<float> x, y, z;

  PointArrays() = default;
  explicit PointArrays(const std::vector<Eigen::Vector3f>& points) : count(points.size()) {
    const size_t padded = (count + kBlock - 1) / kBlock * kBlock;
    for (const auto& [array, axis] : {std::pair{&x, 0}, {&y, 1}, {&z, 2}}) {
      array->assign(padded, std::numeric_limits<float>::quiet_NaN());
      for (size_t i = 0; i < count; ++i) {
        (*array)[i] = points[i][axis];
      }
    }
  }
  size_t blocks() const { return x.size() / kBlock; }
};

// Depth buffer drawn from points instead of triangles: points that cover a surface are splatted
// into square cells. Source: the footnote of the paper on its depth buffer (Algorithm 1).

/// Square cells over a part of an image, and a ring of cells around it. Pixel coordinates as in
/// PixelPoint: the centre of the first pixel is (0.5, 0.5).
struct CellGrid {
  float first_u = 0, first_v = 0;  ///< where cell (0, 0) begins
  float cells_per_pixel = 1;
  int columns = 0;
  int rows = 0;
  /// From this depth on, metres along the optical axis, neighbouring points of the surface project
  /// to the same or to adjacent cells.
  float whole_from_z = 0;

  float cell_width() const { return 1 / cells_per_pixel; }  ///< pixels
  int count() const { return columns * rows; }
};

/// For every cell, the depth of the nearest point in the 3 x 3 cells around it.
///
/// Every position on the surface has a point within the width of a cell, so the buffer has no
/// holes. The outline of an occluder grows by one to two cell widths (once to twice the radius of
/// the points), so that its colours do not leak onto the surface behind it.
class PointDepthBuffer {
 public:
  PointDepthBuffer() = default;
  /// Cells for the part `roi` of the image. `points` cover the surface to `radius_m`
  /// (occluding_points()); their `centroid` decides the width of the cells. World coordinates in
  /// metres; `lens` is camera_of_metres(camera).
  ///
  /// Points outside the lens model or nearer than kNearPlaneMetres are ignored. One thread.
  PointDepthBuffer(const PointArrays& points, const Eigen::Vector3f& centroid, double radius_m,
                   const CameraModel& camera, const VoxelCamera& lens, Rect roi);

  const CellGrid& grid() const { return grid_; }
  /// Depth in metres, row by row; infinity where there is no surface. The outer ring of cells is
  /// not valid.
  const float* nearest() const { return nearest_.data(); }

 private:
  void draw(const PointArrays& points, const VoxelCamera& lens);
  void draw_near(float column, float row, float z);
  void spread_to_neighbours();

  CellGrid grid_;
  std::vector<float> nearest_;
};

// Projects points into the cells of a point depth buffer.

/// One block of points.
struct LocatedPoints {
  static constexpr int32_t kNear = -1;  ///< nearer than CellGrid::whole_from_z: covers many cells
  /// Index of the cell; kNear; or CellGrid::count() for a point outside all cells or the lens
  /// model.
  alignas(64) std::array<int32_t, PointArrays::kBlock> cell;
  alignas(64) std::array<float, PointArrays::kBlock> column, row;  ///< in widths of a cell
  alignas(64) std::array<float, PointArrays::kBlock> z;            ///< metres
};

/// Points `first` to `first` + kBlock. Vectorised by run-time dispatch; every instruction set gives
/// the same bits.
void locate_points(const VoxelCamera& lens, const CellGrid& grid, const PointArrays& points,
                   size_t first, LocatedPoints& located);

}  // namespace v3d::recon
