// How far a camera sees before the surface stops it, in cells finer than the points that tell the
// surface are apart: a depth buffer drawn without triangles.
#pragma once

#include <vector>

#include "base/camera_model.h"
#include "recon/hull/voxel_projection.h"
#include "recon/visibility/surface_points.h"

namespace v3d {

/// Square cells over a part of an image and a ring of cells round it. Pixel coordinates are
/// those of PixelPoint: the centre of the first pixel is (0.5, 0.5).
struct CellGrid {
  float first_u = 0, first_v = 0;  ///< where cell (0, 0) begins
  float cells_per_pixel = 1;
  int columns = 0;
  int rows = 0;
  /// Of a surface from here on, metres along the optical axis, no place lies more than the width of
  /// a cell beside a point in the image.
  float whole_from_z = 0;

  float cell_width() const { return 1 / cells_per_pixel; }  ///< pixels
  int count() const { return columns * rows; }
};

/// The depth that hides what lies behind it, for every cell: of the nearest point in the 3 x 3
/// cells round it. Since every place on the surface has a point within the width of a cell, no hole
/// is left; the edge of an occluder moves outwards by one to two widths of a cell (once to twice
/// the points' radius), so that its colours do not leak onto what lies behind.
class PointDepthBuffer {
 public:
  PointDepthBuffer() = default;
  /// Cells for the part `roi` of the camera's image. `points` cover the surface (see
  /// occluding_points()) to `radius_m`; their `centroid` says how wide a cell must be. Points
  /// outside the lens model and nearer than kNearPlaneMetres hide nothing. `lens` is the camera's
  /// for points in metres. Pure; one thread.
  PointDepthBuffer(const PointArrays& points, const Eigen::Vector3f& centroid, double radius_m,
                   const CameraModel& camera, const VoxelCamera& lens, Rect roi);

  const CellGrid& grid() const { return grid_; }
  /// Row by row, columns side by side; infinity where there is no surface. The outer ring holds no
  /// answer.
  const float* nearest() const { return nearest_.data(); }

 private:
  void draw(const PointArrays& points, const VoxelCamera& lens);
  void draw_near(float column, float row, float z);
  void spread_to_neighbours();

  CellGrid grid_;
  std::vector<float> nearest_;
};

}  // namespace v3d
