#include "recon/visibility/locate_points.h"

// Vector registers of unknown length cannot be members of a struct.
#define HWY_DISABLED_TARGETS (HWY_SVE | HWY_SVE2 | HWY_SVE_256 | HWY_SVE2_128 | HWY_RVV)
#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "recon/visibility/locate_points.cc"
#include <hwy/foreach_target.h>  // compiles this file once per instruction set
#include <hwy/highway.h>

#include <cstring>

#include "recon/render/screen_vertex.h"

HWY_BEFORE_NAMESPACE();
namespace v3d::HWY_NAMESPACE {
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
}  // namespace v3d::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace v3d {

HWY_EXPORT(locate_any);

void locate_points(const VoxelCamera& lens, const CellGrid& grid, const PointArrays& points,
                   size_t first, LocatedPoints& located) {
  HWY_DYNAMIC_DISPATCH(locate_any)(lens, grid, points, first, located);
}

}  // namespace v3d
#endif
