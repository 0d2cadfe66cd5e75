#include "recon/visibility/vertex_visibility.h"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "recon/visibility/vertex_visibility.cc"
#include <hwy/foreach_target.h>  // compiles this file once per instruction set
#include <hwy/highway.h>

#include <cstring>
#include <limits>

#include "recon/render/rasteriser.h"

HWY_BEFORE_NAMESPACE();
namespace v3d::recon::HWY_NAMESPACE {
namespace {

namespace hn = hwy::HWY_NAMESPACE;

#include "recon/hull/voxel_projection_steps.inc"
#include "recon/simd_float.inc"

using LaneMask = hn::Mask<Floats>;

static_assert(PointBlock::kCapacity % kLanes == 0 && VertexVisibility::kCapacity % kLanes == 0);

/// Largest depth change of a slanted surface within a pixel, in widths of a pixel.
constexpr float kMaxSlant = 6;
constexpr float kUnseen = -2;

template <size_t kCount>
HWY_INLINE Lanes get(const std::array<float, kCount>& array, size_t i) {
  return Lanes(hn::Load(Floats(), &array[i]));
}
template <size_t kCount>
HWY_INLINE void put(Lanes value, std::array<float, kCount>& array, size_t i) {
  hn::Store(value.v, Floats(), &array[i]);
}

/// Dot products are x a + (y b + z c), which is the order of operations in Eigen.
struct Vector {
  Lanes x, y, z;
};
HWY_INLINE Lanes dot(const Vector& a, const Vector& b) {
  return a.x * b.x + (a.y * b.y + a.z * b.z);
}
HWY_INLINE Vector vector_at(const PointBlock& points, size_t i) {
  return {get(points.x, i), get(points.y, i), get(points.z, i)};
}

struct Pixels {
  Lanes u, v, z;
  LaneMask exist;
};

template <Lens kLens>
HWY_INLINE Pixels project(const VoxelCamera& lens, const Vector& position) {
  const Floats floats;
  const CameraPoint<Lanes> p =
      HWY_NAMESPACE::camera_point<Lanes>(lens, position.x, position.y, position.z);
  const PixelPoint<Lanes> q = HWY_NAMESPACE::pixel_point<kLens, Lanes>(lens, p);
  const auto before = hn::Ge(p.z.v, hn::Set(floats, static_cast<float>(kNearPlaneMetres)));
  const auto in_lens = hn::Le(q.radius2.v, hn::Set(floats, lens.max_radius2));
  const auto exist = hn::And(before, in_lens);
  const auto nowhere = hn::Set(floats, std::numeric_limits<float>::quiet_NaN());
  return {Lanes(hn::IfThenElse(exist, q.u.v, nowhere)),
          Lanes(hn::IfThenElse(exist, q.v.v, nowhere)), p.z, exist};
}

template <Lens kLens>
void project_with(const VoxelCamera& lens, const PointBlock& points, PixelBlock& pixels) {
  for (size_t i = 0; i < points.count; i += kLanes) {
    const Pixels p = project<kLens>(lens, vector_at(points, i));
    put(p.u, pixels.u, i);
    put(p.v, pixels.v, i);
    put(p.z, pixels.z, i);
  }
}

void project_any(const VoxelCamera& lens, const PointBlock& points, PixelBlock& pixels) {
  switch (lens.lens) {
    case Lens::kPinhole:
      return project_with<Lens::kPinhole>(lens, points, pixels);
    case Lens::kPolynomial:
      return project_with<Lens::kPolynomial>(lens, points, pixels);
    default:
      return project_with<Lens::kFull>(lens, points, pixels);
  }
}

/// The lanes whose pixel lies inside the image.
HWY_INLINE LaneMask in_image(Lanes u, Lanes v, ImageSize size, LaneMask lanes) {
  const Floats floats;
  const auto within = [&](Lanes at, int end) {
    return hn::And(hn::Ge(at.v, hn::Zero(floats)),
                   hn::Lt(at.v, hn::Set(floats, static_cast<float>(end))));
  };
  return hn::And(lanes, hn::And(within(u, size.width), within(v, size.height)));
}

/// The pixel coordinates in `lanes`; 0 in other lanes.
HWY_INLINE hn::Vec<Ints> whole(Lanes at, LaneMask lanes) {
  return truncate(Lanes(hn::IfThenElseZero(lanes, at.v)));
}

HWY_INLINE LaneMask has(const Mask& mask, hn::Vec<Ints> x, hn::Vec<Ints> y) {
  const Ints ints;
  const auto words_in_row = hn::Set(ints, 2 * mask.words_per_row());  // of 32 bits
  const auto word = hn::Add(hn::Mul(y, words_in_row), hn::ShiftRight<5>(x));
  const auto* words = reinterpret_cast<const int32_t*>(mask.row(0).data());
  const auto bits = hn::BitCast(Words(), hn::GatherIndex(ints, words, word));
  const auto place = hn::BitCast(Words(), hn::And(x, hn::Set(ints, 31)));
  return hn::RebindMask(Floats(), hn::TestBit(hn::Shr(bits, place), hn::Set(Words(), 1)));
}

/// Width of a depth sample in metres at a distance of 1 m.
HWY_INLINE float sample_m_per_m(const SurfaceCamera& camera, const DepthBuffer&) {
  return camera.pixel_m_per_m();
}
HWY_INLINE float sample_m_per_m(const SurfaceCamera& camera, const PointDepthBuffer& depth) {
  return camera.pixel_m_per_m() * depth.grid().cell_width();
}

/// SurfaceCamera::sees() in the lanes `wanted`.
HWY_INLINE LaneMask sees(const SurfaceCamera& camera, const DepthBuffer& depth, const Pixels& p,
                         Lanes tolerance, LaneMask wanted) {
  wanted = in_image(p.u, p.v, depth.size, wanted);
  if (bits_of(wanted) == 0) return wanted;
  const auto x = whole(p.u, wanted), y = whole(p.v, wanted);
  const auto index = hn::Add(hn::Mul(y, hn::Set(Ints(), depth.size.width)), x);
  const Lanes nearest(hn::GatherIndex(Floats(), depth.z.data(), index));
  const auto before = hn::Le(p.z.v, (nearest + tolerance).v);
  return hn::And(wanted, hn::And(has(camera.silhouette(), x, y), before));
}

/// The same with a point depth buffer. Its outer ring of cells is not valid.
HWY_INLINE LaneMask sees(const SurfaceCamera& camera, const PointDepthBuffer& depth,
                         const Pixels& p, Lanes tolerance, LaneMask wanted) {
  const CellGrid& grid = depth.grid();
  const Lanes column = (p.u - grid.first_u) * grid.cells_per_pixel,
              row = (p.v - grid.first_v) * grid.cells_per_pixel;
  wanted = in_image(p.u, p.v, camera.silhouette().size(), wanted);
  wanted = in_image(column - 1.0F, row - 1.0F, {grid.columns - 2, grid.rows - 2}, wanted);
  if (bits_of(wanted) == 0) return wanted;
  const auto cells_above = hn::Mul(whole(row, wanted), hn::Set(Ints(), grid.columns));
  const auto cell = hn::Add(cells_above, whole(column, wanted));
  const Lanes nearest(hn::GatherIndex(Floats(), depth.nearest(), cell));
  const auto before = hn::Le(p.z.v, (nearest + tolerance).v);
  const auto foreground = has(camera.silhouette(), whole(p.u, wanted), whole(p.v, wanted));
  return hn::And(wanted, hn::And(foreground, before));
}

void grazing_any(const Mask& pixels, const VertexVisibility& visibility, size_t count,
                 float max_facing, VertexBits& bits) {
  const Floats floats;
  for (size_t i = 0; i < count; i += kLanes) {
    const auto facing = hn::Abs(get(visibility.facing, i).v);
    const auto aside =
        hn::And(hn::Le(facing, hn::Set(floats, max_facing)), hn::FirstN(floats, count - i));
    const Lanes u = get(visibility.u, i), v = get(visibility.v, i);
    const auto wanted = in_image(u, v, pixels.size(), aside);
    if (bits_of(wanted) == 0) continue;
    const auto found = hn::And(wanted, has(pixels, whole(u, wanted), whole(v, wanted)));
    bits[i / 64] |= bits_of(found) << (i % 64);
  }
}

template <Lens kLens, class Depth>
void test_with(const SurfaceCamera& camera, const Depth& depth, const PointBlock& positions,
               const PointBlock& normals, const VisibilityOptions& options,
               VertexVisibility& visibility) {
  const Floats floats;
  const Eigen::Vector3f& center = camera.center();
  for (size_t i = 0; i < positions.count; i += kLanes) {
    const Vector position = vector_at(positions, i);
    const Vector way{Lanes(center.x()) - position.x, Lanes(center.y()) - position.y,
                     Lanes(center.z()) - position.z};
    const Lanes facing = dot(way, vector_at(normals, i)) / Lanes(hn::Sqrt(dot(way, way).v));
    const Pixels p = project<kLens>(camera.lens(), position);
    const auto faces = hn::Ge(facing.v, hn::Set(floats, options.min_facing));
    const Lanes sine2(hn::Max((Lanes(1.0F) - facing * facing).v, hn::Zero(floats)));
    const Lanes slope = Lanes(hn::Sqrt(sine2.v)) / facing;
    const Lanes slant = Lanes(sample_m_per_m(camera, depth)) * p.z *
                        Lanes(hn::Min(slope.v, hn::Set(floats, kMaxSlant)));
    const auto seen =
        sees(camera, depth, p, Lanes(options.tolerance_m) + slant, hn::And(p.exist, faces));
    put(p.u, visibility.u, i);
    put(p.v, visibility.v, i);
    put(p.z, visibility.z, i);
    put(facing, visibility.facing, i);
    put(Lanes(hn::IfThenElse(seen, facing.v, hn::Set(floats, kUnseen))), visibility.seen, i);
  }
}

template <class Depth>
HWY_INLINE void test_all(const SurfaceCamera& camera, const Depth& depth,
                         const PointBlock& positions, const PointBlock& normals,
                         const VisibilityOptions& options, VertexVisibility& visibility) {
  switch (camera.lens().lens) {
    case Lens::kPinhole:
      return test_with<Lens::kPinhole>(camera, depth, positions, normals, options, visibility);
    case Lens::kPolynomial:
      return test_with<Lens::kPolynomial>(camera, depth, positions, normals, options, visibility);
    default:
      return test_with<Lens::kFull>(camera, depth, positions, normals, options, visibility);
  }
}

void test_any(const SurfaceCamera& camera, const DepthBuffer& depth, const PointBlock& positions,
              const PointBlock& normals, const VisibilityOptions& options,
              VertexVisibility& visibility) {
  test_all(camera, depth, positions, normals, options, visibility);
}

void test_cells_any(const SurfaceCamera& camera, const PointDepthBuffer& depth,
                    const PointBlock& positions, const PointBlock& normals,
                    const VisibilityOptions& options, VertexVisibility& visibility) {
  test_all(camera, depth, positions, normals, options, visibility);
}

}  // namespace
}  // namespace v3d::recon::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace v3d::recon {

HWY_EXPORT(project_any);
HWY_EXPORT(test_any);
HWY_EXPORT(test_cells_any);
HWY_EXPORT(grazing_any);

void project_block(const SurfaceCamera& camera, const PointBlock& points, PixelBlock& pixels) {
  HWY_DYNAMIC_DISPATCH(project_any)(camera.lens(), points, pixels);
}

void test_visibility(const SurfaceCamera& camera, const DepthBuffer& depth,
                     const PointBlock& positions, const PointBlock& normals,
                     const VisibilityOptions& options, VertexVisibility& visibility) {
  HWY_DYNAMIC_DISPATCH(test_any)(camera, depth, positions, normals, options, visibility);
}

void test_cell_visibility(const SurfaceCamera& camera, const PointDepthBuffer& depth,
                          const PointBlock& positions, const PointBlock& normals,
                          const VisibilityOptions& options, VertexVisibility& visibility) {
  HWY_DYNAMIC_DISPATCH(test_cells_any)(camera, depth, positions, normals, options, visibility);
}

VertexBits grazing_vertices(const Mask& pixels, const VertexVisibility& visibility, size_t count,
                            float max_facing) {
  VertexBits bits{};
  HWY_DYNAMIC_DISPATCH(grazing_any)(pixels, visibility, count, max_facing, bits);
  return bits;
}

}  // namespace v3d::recon
#endif
