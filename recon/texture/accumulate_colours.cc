#include "recon/texture/texture.h"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "recon/texture/accumulate_colours.cc"
#include <hwy/foreach_target.h>  // compiles this file once per instruction set
#include <hwy/highway.h>

#include <bit>
#include <cstring>

#include "recon/render/rasteriser.h"

HWY_BEFORE_NAMESPACE();
namespace v3d::recon::HWY_NAMESPACE {
namespace {

namespace hn = hwy::HWY_NAMESPACE;

#include "recon/hull/voxel_projection_steps.inc"
#include "recon/simd_float.inc"
#include "recon/texture/simd_sample_colour.inc"

static_assert(PointArrays::kBlock % kMaxLanes == 0);

using LaneMask = hn::Mask<Floats>;

HWY_INLINE Lanes load(const std::vector<float>& array, size_t i) {
  return Lanes(hn::LoadU(Floats(), array.data() + i));
}
HWY_INLINE LaneMask within(Lanes v, float low, float high) {
  const Floats floats;
  return hn::And(hn::Ge(v.v, hn::Set(floats, low)), hn::Lt(v.v, hn::Set(floats, high)));
}

/// The largest lateral error of a PointDepthBuffer: the diagonal of 2 x 2 cells, in widths of a
/// cell.
constexpr float kSlantReach = 2.83F;

/// Capacity: a block of vertices, and one register more. After each test the remaining vertices are
/// compacted, so that the next test works on full registers.
constexpr size_t kRoom = PointArrays::kBlock + kLanes;

/// Vertices that face the camera.
struct FacingVertices {
  alignas(64) float x[kRoom], y[kRoom], z[kRoom];  ///< world, metres
  alignas(64) float facing[kRoom];                 ///< see View
  alignas(64) int32_t number[kRoom];               ///< in the block
  size_t count;
};

/// Vertices that are not hidden.
struct SeenVertices {
  alignas(64) float u[kRoom], v[kRoom];  ///< pixel coordinates of PixelPoint
  alignas(64) float weight[kRoom];
  alignas(64) int32_t number[kRoom];
  size_t count;
};

template <class D>
HWY_INLINE void append(D d, hn::Vec<D> values, hn::Mask<D> lanes, hn::TFromD<D>* end) {
  hn::StoreU(hn::Compress(values, lanes), d, end);
}

/// Projections of vertices, and their weights.
struct View {
  Lanes facing;  ///< cosine between the normal and the optical axis, the weight of equation (9)
  Lanes u, v;    ///< pixel coordinates of PixelPoint
  Lanes z;       ///< metres
  LaneMask lanes;
};

/// The lanes of `view` that no surface in the depth buffer hides.
HWY_INLINE LaneMask not_hidden(const VertexCamera& camera, const View& view) {
  const Floats floats;
  const Ints ints;
  const CellGrid& grid = camera.depth.grid();
  const auto index_of = [&](Lanes at, float first) {
    const Lanes cell = (at - first) * grid.cells_per_pixel;
    return hn::ConvertTo(ints, hn::IfThenElseZero(view.lanes, cell.v));
  };
  const auto column = index_of(view.u, grid.first_u), row = index_of(view.v, grid.first_v);
  const auto cell = hn::Add(hn::Mul(row, hn::Set(ints, grid.columns)), column);
  const Lanes nearest(hn::GatherIndex(floats, camera.depth.nearest(), cell));
  const Lanes sine2 = Lanes(1.0F) - square(view.facing);
  const Lanes slope = Lanes(hn::Sqrt(hn::Max(sine2.v, hn::Zero(floats)))) / view.facing;
  const Lanes give(hn::Min((slope * kSlantReach).v, hn::Set(floats, camera.max_slant)));
  const Lanes max_z = nearest + camera.tolerance_m + give * camera.cell_m_per_m * view.z;
  return hn::Le(view.z.v, max_z.v);
}

/// Classes of ColourMask. A pixel of none of them is outside the mask.
struct PixelClasses {
  LaneMask inner, rim, background_like;
};

HWY_INLINE PixelClasses read_mask(const VertexCamera& camera, hn::Vec<Ints> x, hn::Vec<Ints> y) {
  const Floats floats;
  const Ints ints;
  const Words words;
  const auto index =
      hn::Add(hn::Mul(y, hn::Set(ints, camera.mask.words_per_row())), hn::ShiftRight<4>(x));
  const auto* base = reinterpret_cast<const int32_t*>(camera.mask.words());
  const auto word = hn::BitCast(words, hn::GatherIndex(ints, base, index));
  const auto place = hn::BitCast(words, hn::And(x, hn::Set(ints, 15)));
  const auto pixel = hn::Shr(word, place);
  const auto has = [&](uint32_t bit) {
    return hn::RebindMask(floats, hn::TestBit(pixel, hn::Set(words, bit)));
  };
  const LaneMask low = has(1), high = has(1U << 16);
  return {hn::And(low, high), hn::AndNot(high, low), hn::AndNot(low, high)};
}

/// sample_colour() at (x, y), pixels of the image, for every lane in `wanted`. On return, `wanted`
/// contains the lanes that have a colour.
HWY_INLINE Colour sample_one_by_one(const ImageView& picture, Lanes x, Lanes y, LaneMask& wanted) {
  const Floats floats;
  alignas(64) float across[kLanes], down[kLanes];
  alignas(64) float colour[3][kLanes] = {};
  alignas(64) float found[kLanes] = {};
  hn::Store(x.v, floats, across);
  hn::Store(y.v, floats, down);
  for (uint64_t bits = bits_of(wanted); bits != 0; bits &= bits - 1) {
    const int i = std::countr_zero(bits);
    if (const auto c = sample_colour(picture, across[i], down[i])) {
      for (int k = 0; k < 3; ++k) colour[k][i] = (*c)[k];
      found[i] = 1;
    }
  }
  wanted = hn::Gt(hn::Load(floats, found), hn::Zero(floats));
  const auto channel = [&](int k) { return Lanes(hn::Load(floats, colour[k])); };
  return {channel(0), channel(1), channel(2)};
}

/// The colours at all lanes in `lanes`. On return, `lanes` contains those that have a colour. (u,
/// v) are pixel coordinates of PixelPoint.
HWY_INLINE Colour sample(const VertexCamera& camera, Lanes u, Lanes v, LaneMask& lanes) {
  const Frame& frame = *camera.frame;
  const ImageView picture = camera.demosaiced ? camera.demosaiced->view() : frame.image.view();
  const Lanes x = u - (static_cast<float>(frame.roi.x0) + 0.5F);
  const Lanes y = v - (static_cast<float>(frame.roi.y0) + 0.5F);
  if (picture.format == PixelFormat::kMono8) return sample_one_by_one(picture, x, y, lanes);
  LaneMask quick = hn::And(lanes, far_from_border(picture, x, y));
  if (bits_of(quick) == 0) return sample_one_by_one(picture, x, y, lanes);
  const Lanes x_quick(hn::IfThenElseZero(quick, x.v)), y_quick(hn::IfThenElseZero(quick, y.v));
  Colour colour = picture.format == PixelFormat::kRGB8
                      ? sample_rgb(picture, x_quick, y_quick)
                      : sample_bayer(picture, x_quick, y_quick, quick);
  LaneMask slow = hn::AndNot(quick, lanes);
  if (bits_of(slow) != 0) {
    const Colour other = sample_one_by_one(picture, x, y, slow);
    for (int k = 0; k < 3; ++k) {
      colour.channel[k] = Lanes(hn::IfThenElse(slow, other.channel[k].v, colour.channel[k].v));
    }
    lanes = hn::Or(quick, slow);
  }
  return colour;
}

HWY_INLINE void find_facing(const VertexCamera& camera, const PointArrays& vertices,
                            const PointArrays& normals, size_t first, FacingVertices& found) {
  const Floats floats;
  const Ints ints;
  size_t count = 0;
  for (size_t i = 0; i < PointArrays::kBlock; i += kLanes) {
    const size_t at = first + i;
    const Lanes facing = Lanes(0.0F) - (load(normals.x, at) * camera.axis.x() +
                                        load(normals.y, at) * camera.axis.y() +
                                        load(normals.z, at) * camera.axis.z());
    const LaneMask faces = hn::Gt(facing.v, hn::Zero(floats));
    append(floats, load(vertices.x, at).v, faces, found.x + count);
    append(floats, load(vertices.y, at).v, faces, found.y + count);
    append(floats, load(vertices.z, at).v, faces, found.z + count);
    append(floats, facing.v, faces, found.facing + count);
    append(ints, hn::Iota(ints, static_cast<int32_t>(i)), hn::RebindMask(ints, faces),
           found.number + count);
    count += hn::CountTrue(floats, faces);
  }
  found.count = count;
}

/// Weights of the colours of these vertices.
HWY_INLINE Lanes weight_of(const VertexCamera& camera, const View& view) {
  if (camera.weight) return Lanes(*camera.weight);
  if (camera.resolution > 0) return square(view.facing * camera.resolution / view.z);
  return view.facing;
}

template <Lens kLens>
HWY_INLINE void find_seen(const VertexCamera& camera, const FacingVertices& facing,
                          SeenVertices& found) {
  const Floats floats;
  const Ints ints;
  const Rect& roi = camera.frame->roi;
  const auto get = [&](const float* array) { return Lanes(hn::Load(floats, array)); };
  size_t count = 0;
  for (size_t i = 0; i < facing.count; i += kLanes) {
    const CameraPoint<Lanes> p = HWY_NAMESPACE::camera_point<Lanes>(
        camera.lens, get(facing.x + i), get(facing.y + i), get(facing.z + i));
    const PixelPoint<Lanes> q = HWY_NAMESPACE::pixel_point<kLens, Lanes>(camera.lens, p);
    const auto in_lens =
        hn::And(hn::Ge(p.z.v, hn::Set(floats, static_cast<float>(kNearPlaneMetres))),
                hn::Le(q.radius2.v, hn::Set(floats, camera.lens.max_radius2)));
    const auto in_roi =
        hn::And(within(q.u, roi.x0, roi.x0 + roi.width), within(q.v, roi.y0, roi.y0 + roi.height));
    const LaneMask there = hn::FirstN(floats, facing.count - i);
    View view{get(facing.facing + i), q.u, q.v, p.z, hn::And(there, hn::And(in_lens, in_roi))};
    const LaneMask seen = hn::And(view.lanes, not_hidden(camera, view));
    append(floats, q.u.v, seen, found.u + count);
    append(floats, q.v.v, seen, found.v + count);
    append(floats, weight_of(camera, view).v, seen, found.weight + count);
    append(ints, hn::Load(ints, facing.number + i), hn::RebindMask(ints, seen),
           found.number + count);
    count += hn::CountTrue(floats, seen);
  }
  found.count = count;
}

/// The camera's colours in the common response of its rig.
HWY_INLINE Colour corrected(const SampleCorrection& correction, const Colour& colour) {
  const Floats floats;
  const auto channel = [&](int k) {
    const Lanes sum = colour.channel[0] * correction.matrix(k, 0) +
                      colour.channel[1] * correction.matrix(k, 1) +
                      colour.channel[2] * correction.matrix(k, 2) + correction.offset[k];
    return Lanes(hn::Clamp(sum.v, hn::Zero(floats), hn::Set(floats, 255.0F)));
  };
  return {channel(0), channel(1), channel(2)};
}

/// Adds colour and weight of every lane in `lanes` to the sums of its vertex.
HWY_INLINE void add(const Colour& colour, Lanes weight, LaneMask lanes, const PixelClasses& classes,
                    const int32_t* number, ColourSums& sums) {
  alignas(64) float products[4 * kLanes];
  hn::StoreInterleaved4((weight * colour.channel[0]).v, (weight * colour.channel[1]).v,
                        (weight * colour.channel[2]).v, weight.v, Floats(), products);
  const uint64_t inner = bits_of(classes.inner);
  const uint64_t background_like = bits_of(classes.background_like);
  for (uint64_t bits = bits_of(lanes); bits != 0; bits &= bits - 1) {
    const int lane = std::countr_zero(bits);
    auto& of_class = inner >> lane & 1             ? sums.inner
                     : background_like >> lane & 1 ? sums.background_like
                                                   : sums.rim;
    auto& sum = of_class[number[lane]];
    for (int k = 0; k < 4; ++k) sum[k] += products[4 * lane + k];
  }
}

HWY_INLINE void sample_seen(const VertexCamera& camera, const SeenVertices& found,
                            ColourSums& sums) {
  const Floats floats;
  const Ints ints;
  const Rect& roi = camera.frame->roi;
  for (size_t i = 0; i < found.count; i += kLanes) {
    const LaneMask there = hn::FirstN(floats, found.count - i);
    const Lanes u(hn::IfThenElseZero(there, hn::Load(floats, found.u + i)));
    const Lanes v(hn::IfThenElseZero(there, hn::Load(floats, found.v + i)));
    const auto pixel = [&](Lanes where, int origin) {
      const auto whole = hn::Sub(hn::ConvertTo(ints, where.v), hn::Set(ints, origin));
      return hn::IfThenElseZero(hn::RebindMask(ints, there), whole);
    };
    const PixelClasses classes = read_mask(camera, pixel(u, roi.x0), pixel(v, roi.y0));
    const LaneMask in_mask = hn::Or(hn::Or(classes.inner, classes.rim), classes.background_like);
    LaneMask seen = hn::And(there, in_mask);
    if (bits_of(seen) == 0) continue;
    Colour colour = sample(camera, u, v, seen);
    if (camera.colour) colour = corrected(*camera.colour, colour);
    add(colour, Lanes(hn::Load(floats, found.weight + i)), seen, classes, found.number + i, sums);
  }
}

template <Lens kLens>
void accumulate_block(const VertexCamera& camera, const PointArrays& vertices,
                      const PointArrays& normals, size_t first, ColourSums& sums) {
  FacingVertices facing;
  find_facing(camera, vertices, normals, first, facing);
  SeenVertices seen;
  find_seen<kLens>(camera, facing, seen);
  sample_seen(camera, seen, sums);
}

void accumulate_any(const VertexCamera& camera, const PointArrays& vertices,
                    const PointArrays& normals, size_t first, ColourSums& sums) {
  switch (camera.lens.lens) {
    case Lens::kPinhole:
      return accumulate_block<Lens::kPinhole>(camera, vertices, normals, first, sums);
    case Lens::kPolynomial:
      return accumulate_block<Lens::kPolynomial>(camera, vertices, normals, first, sums);
    default:
      return accumulate_block<Lens::kFull>(camera, vertices, normals, first, sums);
  }
}

}  // namespace
}  // namespace v3d::recon::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace v3d::recon {

HWY_EXPORT(accumulate_any);

void accumulate_vertex_colours(const VertexCamera& camera, const PointArrays& vertices,
                               const PointArrays& normals, size_t first, ColourSums& sums) {
  HWY_DYNAMIC_DISPATCH(accumulate_any)(camera, vertices, normals, first, sums);
}

}  // namespace v3d::recon
#endif
