// Projects points into the cells of a point depth buffer.
#pragma once

#include <array>
#include <cstdint>

#include "recon/hull/voxel_projection.h"
#include "recon/visibility/point_depth_buffer.h"
#include "recon/visibility/surface_points.h"

namespace v3d {

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

}  // namespace v3d
