#include "recon/hull/slender_silhouettes.h"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "recon/hull/slender_silhouettes.cc"
#include <hwy/foreach_target.h>  // compiles this file once per instruction set
#include <hwy/highway.h>

#include <algorithm>
#include <cmath>
#include <utility>

#include "base/core/error.h"

HWY_BEFORE_NAMESPACE();
namespace v3d::recon::HWY_NAMESPACE {
namespace {

// Plain loops over consecutive words, which the compiler vectorises. The words before `in` and
// behind its end are readable. A row is a run of words, pixel x in bit x % 64.

/// Both a pixel and the one `step` to the right of it; step from 1 to 63.
void and_right(const uint64_t* HWY_RESTRICT in, size_t words, int step,
               uint64_t* HWY_RESTRICT out) {
  for (size_t i = 0; i < words; ++i) out[i] = in[i] & (in[i] >> step | in[i + 1] << (64 - step));
}

/// Both a pixel and the one `step` to the left of it.
void and_left(const uint64_t* HWY_RESTRICT in, size_t words, int step, uint64_t* HWY_RESTRICT out) {
  for (size_t i = 0; i < words; ++i) out[i] = in[i] & (in[i] << step | (in + i)[-1] >> (64 - step));
}

/// A pixel or the one `step` to the right of it.
void or_right(const uint64_t* HWY_RESTRICT in, size_t words, int step, uint64_t* HWY_RESTRICT out) {
  for (size_t i = 0; i < words; ++i) out[i] = in[i] | in[i] >> step | in[i + 1] << (64 - step);
}

/// A pixel or the one `step` to the left of it.
void or_left(const uint64_t* HWY_RESTRICT in, size_t words, int step, uint64_t* HWY_RESTRICT out) {
  for (size_t i = 0; i < words; ++i) out[i] = in[i] | in[i] << step | (in + i)[-1] >> (64 - step);
}

/// Both a pixel and the one at the same place `distance` words further.
void and_rows(const uint64_t* HWY_RESTRICT in, size_t words, int64_t distance,
              uint64_t* HWY_RESTRICT out) {
  for (size_t i = 0; i < words; ++i) out[i] = in[i] & (in + i)[distance];
}

/// A pixel or the one at the same place `distance` words further; negative: before.
void or_rows(const uint64_t* HWY_RESTRICT in, size_t words, int64_t distance,
             uint64_t* HWY_RESTRICT out) {
  for (size_t i = 0; i < words; ++i) out[i] = in[i] | (in + i)[distance];
}

/// Pixels of `all` that `some` does not have. Returns true when there are any.
bool and_not(const uint64_t* HWY_RESTRICT all, const uint64_t* HWY_RESTRICT some, size_t words,
             uint64_t* HWY_RESTRICT out) {
  uint64_t any = 0;
  for (size_t i = 0; i < words; ++i) {
    out[i] = all[i] & ~some[i];
    any |= out[i];
  }
  return any != 0;
}

}  // namespace
}  // namespace v3d::recon::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace v3d::recon {

HWY_EXPORT(and_right);
HWY_EXPORT(and_left);
HWY_EXPORT(or_right);
HWY_EXPORT(or_left);
HWY_EXPORT(and_rows);
HWY_EXPORT(or_rows);
HWY_EXPORT(and_not);

namespace {

// In voxels. Chosen by `tools/bench/ablation slender` on seed 1.
constexpr double kSlender = 2;
constexpr double kGap = 6;
constexpr double kReach = 0.65;

}  // namespace

SlenderSizes SlenderSizes::for_camera(const CameraModel& camera, const Box& space, double voxel_m) {
  constexpr SlenderSizes kMax = SlenderSilhouettes::kMax;
  // A camera in the middle of the space gets the largest sizes.
  const double distance = std::max((camera.center() - space.center()).norm(), voxel_m);
  const double voxel_px = camera.matrix()(0, 0) * voxel_m / distance;
  const auto limited = [](double pixels, int limit) {
    return static_cast<int>(std::min(pixels, static_cast<double>(limit)));
  };
  return {.side = std::max(1, limited(std::ceil(kSlender * voxel_px), kMax.side)),
          .gap = limited(std::ceil(kGap * voxel_px), kMax.gap),
          .reach = limited(std::floor(kReach * voxel_px), kMax.reach)};
}

SlenderSilhouettes::SlenderSilhouettes(ImageSize size, const SlenderSizes& sizes)
    : sizes_(sizes), widened_(size) {
  V3D_CHECK(sizes.side >= 1 && sizes.side <= kMax.side);
  V3D_CHECK(sizes.gap >= 0 && sizes.gap <= kMax.gap);
  V3D_CHECK(sizes.reach >= 0 && sizes.reach <= kMax.reach);
  const size_t stride = static_cast<size_t>(widened_.words_per_row()) + 1;
  const size_t margin =
      stride * static_cast<size_t>(std::max({sizes.side, sizes.gap, sizes.reach}));
  for (Plane* plane : {&foreground_, &bits_, &next_}) {
    plane->margin = margin;
    plane->words.resize(2 * margin + stride * static_cast<size_t>(size.height + sizes.gap));
  }
}

const Mask& SlenderSilhouettes::widen(const Mask& mask) {
  V3D_CHECK(mask.size() == widened_.size());
  if (sizes_.reach == 0) return mask;
  const Rect box = mask.bounding_box();
  if (box.empty()) return mask;
  const Region region = region_of(box);
  load(mask, region);
  if (!find_slender(region)) return mask;
  close_gaps(region);
  widen_slender(region);
  store(mask, region);
  return widened_;
}

SlenderSilhouettes::Region SlenderSilhouettes::region_of(const Rect& box) const {
  const ImageSize size = widened_.size();
  const int end_x = std::min(size.width, box.x0 + box.width + sizes_.reach);
  const int end_y = std::min(size.height, box.y0 + box.height + sizes_.reach);
  Region region;
  region.first_word = std::max(0, box.x0 - sizes_.reach) / 64;
  region.words = (end_x + 63) / 64 - region.first_word;
  region.first_row = std::max(0, box.y0 - sizes_.reach) - sizes_.gap;
  region.rows = end_y - region.first_row;
  return region;
}

void SlenderSilhouettes::load(const Mask& mask, const Region& region) {
  // An earlier, larger region left its bits behind the end of this one.
  for (Plane* plane : {&foreground_, &bits_, &next_}) {
    std::fill_n(plane->data() + region.size(), plane->margin, 0);
  }
  std::fill_n(foreground_.data(), region.size(), 0);
  for (int row = std::max(0, -region.first_row); row < region.rows; ++row) {
    const auto words = mask.row(region.first_row + row).subspan(region.first_word, region.words);
    std::ranges::copy(words, foreground_.data() + region.stride() * row);
  }
  std::copy_n(foreground_.data(), region.size(), bits_.data());
}

void SlenderSilhouettes::combine(int count, PixelStep pixels, RowStep rows, int64_t row_words,
                                 const Region& region) {
  for (int combined = 1; combined < count;) {
    const int step = std::min(combined, count - combined);
    pixels(bits_.data(), region.size(), step, next_.data());
    rows(next_.data(), region.size(), step * row_words, bits_.data());
    combined += step;
  }
}

bool SlenderSilhouettes::find_slender(const Region& region) {
  const auto row = static_cast<int64_t>(region.stride());
  // Erosion: squares of foreground, at their first pixel. Dilation: all pixels of these squares.
  combine(sizes_.side, HWY_DYNAMIC_DISPATCH(and_right), HWY_DYNAMIC_DISPATCH(and_rows), row,
          region);
  combine(sizes_.side, HWY_DYNAMIC_DISPATCH(or_left), HWY_DYNAMIC_DISPATCH(or_rows), -row, region);
  const bool found =
      HWY_DYNAMIC_DISPATCH(and_not)(foreground_.data(), bits_.data(), region.size(), next_.data());
  std::swap(bits_, next_);
  return found;
}

void SlenderSilhouettes::close_gaps(const Region& region) {
  const auto row = static_cast<int64_t>(region.stride());
  combine(sizes_.gap, HWY_DYNAMIC_DISPATCH(or_right), HWY_DYNAMIC_DISPATCH(or_rows), row, region);
  combine(sizes_.gap, HWY_DYNAMIC_DISPATCH(and_left), HWY_DYNAMIC_DISPATCH(and_rows), -row, region);
}

void SlenderSilhouettes::widen_slender(const Region& region) {
  const auto row = static_cast<int64_t>(region.stride());
  // A pixel that leaves its row enters the word behind the row, within `reach` bits of its ends.
  const int count = sizes_.reach + 1;
  combine(count, HWY_DYNAMIC_DISPATCH(or_left), HWY_DYNAMIC_DISPATCH(or_rows), -row, region);
  combine(count, HWY_DYNAMIC_DISPATCH(or_right), HWY_DYNAMIC_DISPATCH(or_rows), row, region);
}

void SlenderSilhouettes::store(const Mask& mask, const Region& region) {
  widened_ = mask;
  const int tail = mask.size().width % 64;
  const uint64_t last = tail == 0 ? ~uint64_t{0} : (uint64_t{1} << tail) - 1;
  for (int row = std::max(0, -region.first_row); row < region.rows; ++row) {
    const std::span<uint64_t> words = widened_.row(region.first_row + row);
    const uint64_t* wider = bits_.data() + region.stride() * row;
    for (int w = 0; w < region.words; ++w) words[region.first_word + w] |= wider[w];
    words.back() &= last;
  }
}

}  // namespace v3d::recon
#endif
