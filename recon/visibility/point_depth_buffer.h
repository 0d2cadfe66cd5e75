// Depth buffer drawn from points instead of triangles: points that cover a surface are splatted
// into square cells. Source: the footnote of the paper on its depth buffer (Algorithm 1).
#pragma once

#include <vector>

#include "base/geometry/camera_model.h"
#include "recon/hull/voxel_projection.h"
#include "recon/visibility/surface_points.h"

namespace v3d {

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
/// Every place of the surface has a point within the width of a cell, so the buffer has no holes.
/// The outline of an occluder grows by one to two cell widths (once to twice the radius of the
/// points), so that its colours do not leak onto the surface behind it.
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

}  // namespace v3d
