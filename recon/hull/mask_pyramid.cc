#include "recon/hull/mask_pyramid.h"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "recon/hull/mask_pyramid.cc"
#include <hwy/foreach_target.h>  // compiles this file once per instruction set
#include <hwy/highway.h>

#include <algorithm>
#include <cstring>

#include "base/core/error.h"

#ifndef V3D_RECON_MASK_PYRAMID_ONCE
#define V3D_RECON_MASK_PYRAMID_ONCE
namespace v3d::recon {
namespace {

/// Two neighbouring strips of a level. The bits of each beyond the end of its rows are set in the
/// other two members.
struct StripPair {
  const uint32_t* left;
  const uint32_t* right;
  uint32_t beyond_left = 0;
  uint32_t beyond_right = 0;
};

}  // namespace
}  // namespace v3d::recon
#endif

HWY_BEFORE_NAMESPACE();
namespace v3d::recon::HWY_NAMESPACE {
namespace {

namespace hn = hwy::HWY_NAMESPACE;

#include "recon/simd_float.inc"
// This file uses the types of simd_float.inc:
#include "recon/hull/simd_mask_window.inc"

/// Bits 0, 2, 4, ... of x, packed into the low half.
HWY_INLINE uint32_t even_bits(uint32_t x) {
  x &= 0x55555555;
  x = (x | x >> 1) & 0x33333333;
  x = (x | x >> 2) & 0x0F0F0F0F;
  x = (x | x >> 4) & 0x00FF00FF;
  return (x | x >> 8) & 0x0000FFFF;
}

// Plain loops over consecutive words, which the compiler vectorises.

/// Cells [begin, end) of a strip: set when any of the four finer cells is set.
void halve_any(const StripPair& fine, int begin, int end, uint32_t* coarse) {
  for (int y = begin; y < end; ++y) {
    const uint32_t left = fine.left[2 * y] | fine.left[2 * y + 1];
    const uint32_t right = fine.right[2 * y] | fine.right[2 * y + 1];
    coarse[y] = even_bits(left | left >> 1) | even_bits(right | right >> 1) << 16;
  }
}

/// Cells [begin, end) of a strip: set when all four finer cells are set.
void halve_all(const StripPair& fine, int begin, int end, uint32_t* coarse) {
  for (int y = begin; y < end; ++y) {
    const uint32_t left = (fine.left[2 * y] & fine.left[2 * y + 1]) | fine.beyond_left;
    const uint32_t right = (fine.right[2 * y] & fine.right[2 * y + 1]) | fine.beyond_right;
    coarse[y] = even_bits(left & left >> 1) | even_bits(right & right >> 1) << 16;
  }
}

MaskCoverage coverage(const MaskPyramid& mask, int x0, int y0, int x1, int y1) {
  return coverage_of(mask, x0, y0, x1, y1);
}

}  // namespace
}  // namespace v3d::recon::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace v3d::recon {

HWY_EXPORT(halve_any);
HWY_EXPORT(halve_all);
HWY_EXPORT(coverage);

namespace {

constexpr int kStripWidth = 32;
constexpr uint32_t kAllOnes = ~uint32_t{0};
/// The last level has at most this many cells along each side.
constexpr int kMinCells = 16;

int strips(int width) { return (width + kStripWidth - 1) / kStripWidth; }

/// The bits of strip `s` that are beyond the end of a row of `width` cells.
uint32_t beyond_end(int s, int width) {
  const int bits = std::clamp(width - s * kStripWidth, 0, kStripWidth);
  return bits == kStripWidth ? 0 : kAllOnes << bits;
}

/// The cells of a level that touch a rectangle of pixels, and the strips that contain them. All
/// limits are inclusive.
struct CellRange {
  int first_strip, last_strip, first_y, last_y;
};

CellRange cells_of(const Rect& box, int level) {
  return {(box.x0 >> level) / kStripWidth, ((box.x0 + box.width - 1) >> level) / kStripWidth,
          box.y0 >> level, (box.y0 + box.height - 1) >> level};
}

}  // namespace

MaskPyramid::MaskPyramid(ImageSize size) {
  V3D_CHECK(size.width > 0 && size.height > 0);
  for (;;) {
    Level level;
    level.size = size;
    // One additional strip, so that two neighbouring strips can always be read at once.
    level.any.resize(static_cast<size_t>(strips(size.width) + 1) * size.height + kPadding);
    if (!levels_.empty()) level.all.resize(level.any.size());
    levels_.push_back(std::move(level));
    if (size.width <= kMinCells && size.height <= kMinCells) break;
    size = {(size.width + 1) / 2, (size.height + 1) / 2};
  }
}

void MaskPyramid::build(const Mask& mask) {
  V3D_CHECK(mask.size() == size());
  if (!filled_.empty()) clear();
  filled_ = mask.bounding_box();
  if (filled_.empty()) return;
  copy(mask);
  for (size_t n = 1; n < levels_.size(); ++n) halve(static_cast<int>(n));
}

void MaskPyramid::clear() {
  for (size_t n = 0; n < levels_.size(); ++n) {
    Level& level = levels_[n];
    const CellRange range = cells_of(filled_, static_cast<int>(n));
    for (int s = range.first_strip; s <= range.last_strip; ++s) {
      const size_t at = static_cast<size_t>(s) * level.size.height + range.first_y;
      const int count = range.last_y - range.first_y + 1;
      std::fill_n(&level.any[at], count, 0);
      if (n > 0) std::fill_n(&level.all[at], count, 0);
    }
  }
}

void MaskPyramid::copy(const Mask& mask) {
  Level& base = levels_.front();
  const CellRange range = cells_of(filled_, 0);
  for (int y = range.first_y; y <= range.last_y; ++y) {
    const auto row = mask.row(y);
    for (int s = range.first_strip; s <= range.last_strip; ++s) {
      const auto word = static_cast<uint32_t>(row[s / 2] >> (s % 2 * kStripWidth));
      base.any[static_cast<size_t>(s) * base.size.height + y] = word;
    }
  }
}

void MaskPyramid::halve(int level) {
  const Level& fine = levels_[level - 1];
  Level& coarse = levels_[level];
  const std::vector<uint32_t>& fine_all = level == 1 ? fine.any : fine.all;
  const CellRange range = cells_of(filled_, level);
  for (int s = range.first_strip; s <= range.last_strip; ++s) {
    const int height = fine.size.height;
    const size_t left = static_cast<size_t>(2 * s) * height;
    const bool has_right = 2 * s + 1 < strips(fine.size.width);
    const size_t right = has_right ? left + height : strips(fine.size.width) * size_t(height);
    const StripPair any{&fine.any[left], &fine.any[right]};
    const StripPair all{&fine_all[left], &fine_all[right], beyond_end(2 * s, fine.size.width),
                        beyond_end(2 * s + 1, fine.size.width)};
    const size_t out = static_cast<size_t>(s) * coarse.size.height;
    const int pairs_end = std::min(range.last_y + 1, height / 2);
    HWY_DYNAMIC_DISPATCH(halve_any)(any, range.first_y, pairs_end, &coarse.any[out]);
    HWY_DYNAMIC_DISPATCH(halve_all)(all, range.first_y, pairs_end, &coarse.all[out]);
    if (pairs_end <= range.last_y) {
      // The last row has no pair when the number of rows is odd: combine it with itself.
      const int y = height - 1;
      const uint32_t any_rows[4]{any.left[y], any.left[y], any.right[y], any.right[y]};
      const uint32_t all_rows[4]{all.left[y], all.left[y], all.right[y], all.right[y]};
      HWY_DYNAMIC_DISPATCH(halve_any)
      ({any_rows, any_rows + 2}, 0, 1, &coarse.any[out + pairs_end]);
      HWY_DYNAMIC_DISPATCH(halve_all)
      ({all_rows, all_rows + 2, all.beyond_left, all.beyond_right}, 0, 1,
       &coarse.all[out + pairs_end]);
    }
  }
}

MaskCoverage MaskPyramid::coverage(int x0, int y0, int x1, int y1) const {
  V3D_DEBUG_CHECK(0 <= x0 && x0 <= x1 && x1 < size().width && 0 <= y0 && y0 <= y1 &&
                  y1 < size().height);
  return HWY_DYNAMIC_DISPATCH(coverage)(*this, x0, y0, x1, y1);
}

}  // namespace v3d::recon
#endif
