#include "recon/carve_brick.h"

// Registers of unknown length cannot be members of a struct.
#define HWY_DISABLED_TARGETS (HWY_SVE | HWY_SVE2 | HWY_SVE_256 | HWY_SVE2_128 | HWY_RVV)
#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "recon/carve_brick.cc"
#include <hwy/foreach_target.h>  // compiles this file once per instruction set
#include <hwy/highway.h>

#include <array>
#include <cstring>

HWY_BEFORE_NAMESPACE();
namespace v3d::HWY_NAMESPACE {
namespace {

namespace hn = hwy::HWY_NAMESPACE;

#include "recon/lanes.inc"
#include "recon/voxel_projection_steps.inc"

constexpr int kLayer = kBrickEdge * kBrickEdge;
static_assert(kLayer == kMostLanes);

/// Places of a layer's voxels along x and y, in the order of their bits.
struct LayerPlaces {
  alignas(64) float x[kLayer];
  alignas(64) float y[kLayer];
};

constexpr LayerPlaces places_in_layer() {
  LayerPlaces places{};
  for (int y = 0; y < kBrickEdge; ++y) {
    for (int x = 0; x < kBrickEdge; ++x) {
      places.x[kBrickEdge * y + x] = static_cast<float>(x);
      places.y[kBrickEdge * y + x] = static_cast<float>(y);
    }
  }
  return places;
}
constexpr LayerPlaces kPlaces = places_in_layer();

struct LaneBits {
  uint64_t seen, background;
};

/// project_voxel() and the look at the mask, for as many voxels as there are lanes.
template <Lens kLens>
HWY_INLINE LaneBits view_voxels(const VoxelCamera& c, const MaskPyramid& mask, Lanes i, Lanes j,
                                Lanes k) {
  const Floats floats;
  const Ints ints;
  const Words words;
  const CameraPoint<Lanes> p = HWY_NAMESPACE::camera_point<Lanes>(c, i, j, k);
  const PixelPoint<Lanes> q = HWY_NAMESPACE::pixel_point<kLens, Lanes>(c, p);
  const auto zero = hn::Zero(floats);
  const auto in_lens =
      hn::And(hn::Gt(p.z.v, zero), hn::Le(q.radius2.v, hn::Set(floats, c.max_radius2)));
  const auto in_columns = hn::And(hn::Ge(q.u.v, zero), hn::Lt(q.u.v, hn::Set(floats, c.width)));
  const auto in_rows = hn::And(hn::Ge(q.v.v, zero), hn::Lt(q.v.v, hn::Set(floats, c.height)));
  const auto seen = hn::And(in_lens, hn::And(in_columns, in_rows));
  // Lanes that are not seen look at pixel (0, 0), and what they find is not used.
  const auto x = hn::ConvertTo(ints, hn::IfThenElseZero(seen, q.u.v));
  const auto y = hn::ConvertTo(ints, hn::IfThenElseZero(seen, q.v.v));
  const auto index = hn::Add(hn::Mul(y, hn::Set(ints, mask.words_per_row())), hn::ShiftRight<5>(x));
  const auto word = hn::BitCast(
      words, hn::GatherIndex(ints, reinterpret_cast<const int32_t*>(mask.pixels()), index));
  const auto place = hn::BitCast(words, hn::And(x, hn::Set(ints, 31)));
  const auto pixel = hn::And(hn::Shr(word, place), hn::Set(words, 1));
  const auto is_background = hn::RebindMask(floats, hn::Eq(pixel, hn::Zero(words)));
  return {bits_of(seen), bits_of(hn::And(seen, is_background))};
}

template <Lens kLens>
BrickView view(const VoxelCamera& camera, const MaskPyramid& mask, BrickCoord at,
               const Brick& candidates) {
  const Floats floats;
  const int lanes = static_cast<int>(hn::Lanes(floats));
  const uint64_t one_register = ~uint64_t{0} >> (kLayer - lanes);
  const Lanes first_x(static_cast<float>(kBrickEdge * at.x));
  const Lanes first_y(static_cast<float>(kBrickEdge * at.y));
  BrickView result;
  for (int z = 0; z < kBrickEdge; ++z) {
    if (candidates[z] == 0) continue;
    const Lanes k(static_cast<float>(kBrickEdge * at.z + z));
    for (int n = 0; n < kLayer; n += lanes) {
      if ((candidates[z] & one_register << n) == 0) continue;
      const Lanes i = first_x + Lanes(hn::Load(floats, kPlaces.x + n));
      const Lanes j = first_y + Lanes(hn::Load(floats, kPlaces.y + n));
      const LaneBits found = view_voxels<kLens>(camera, mask, i, j, k);
      result.seen[z] |= found.seen << n;
      result.background[z] |= found.background << n;
    }
    result.seen[z] &= candidates[z];
    result.background[z] &= candidates[z];
  }
  return result;
}

BrickView view_any(const VoxelCamera& camera, const MaskPyramid& mask, BrickCoord at,
                   const Brick& candidates) {
  switch (camera.lens) {
    case Lens::kPinhole:
      return view<Lens::kPinhole>(camera, mask, at, candidates);
    case Lens::kPolynomial:
      return view<Lens::kPolynomial>(camera, mask, at, candidates);
    default:
      return view<Lens::kFull>(camera, mask, at, candidates);
  }
}

}  // namespace
}  // namespace v3d::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace v3d {

HWY_EXPORT(view_any);

BrickView view_brick(const VoxelCamera& camera, const MaskPyramid& mask, BrickCoord at,
                     const Brick& candidates) {
  return HWY_DYNAMIC_DISPATCH(view_any)(camera, mask, at, candidates);
}

}  // namespace v3d
#endif
