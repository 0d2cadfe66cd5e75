#include "recon/mask_pyramid.h"

#include <algorithm>
#include <bit>
#include <cassert>
#include <cstring>

namespace v3d {
namespace {

static_assert(std::endian::native == std::endian::little, "64-bit rows are read as 32-bit words");

constexpr int kWordBits = 32;
constexpr uint32_t kAllOnes = ~uint32_t{0};
/// A rectangle is looked up on the finest level where it has at most so many cells along each side.
constexpr int kMaxCells = 32;

/// Bits 0, 2, 4, ... of x, moved together.
uint32_t even_bits(uint64_t x) {
  x &= 0x5555555555555555;
  x = (x | x >> 1) & 0x3333333333333333;
  x = (x | x >> 2) & 0x0F0F0F0F0F0F0F0F;
  x = (x | x >> 4) & 0x00FF00FF00FF00FF;
  x = (x | x >> 8) & 0x0000FFFF0000FFFF;
  return static_cast<uint32_t>(x | x >> 16);
}

uint64_t join(uint32_t low, uint32_t high) { return low | uint64_t{high} << kWordBits; }

/// The bits of word `w` of a row of `width` cells that are beyond the row's end.
uint32_t beyond_end(int w, int width) {
  const int bits = std::clamp(width - w * kWordBits, 0, kWordBits);
  return bits == kWordBits ? 0 : kAllOnes << bits;
}

}  // namespace

MaskPyramid::MaskPyramid(ImageSize size) {
  assert(size.width > 0 && size.height > 0);
  for (;;) {
    Level level;
    level.size = size;
    // One word more than needed, so that two neighbours can always be read at once; even, so that
    // rows of level 0 are rows of the mask.
    level.words_per_row = (size.width + 63) / 64 * 2 + 1;
    level.any.resize(static_cast<size_t>(level.words_per_row) * size.height);
    if (!levels_.empty()) level.all.resize(level.any.size());
    levels_.push_back(std::move(level));
    if (size.width <= kMaxCells && size.height <= kMaxCells) break;
    size = {(size.width + 1) / 2, (size.height + 1) / 2};
  }
}

void MaskPyramid::build(const Mask& mask) {
  assert(mask.size() == size());
  for (size_t n = 1; n < levels_.size() && !filled_.empty(); ++n) {
    std::fill(levels_[n].any.begin(), levels_[n].any.end(), 0);
    std::fill(levels_[n].all.begin(), levels_[n].all.end(), 0);
  }
  copy(mask);
  filled_ = mask.bounding_box();
  for (size_t n = 1; n < levels_.size() && !filled_.empty(); ++n) {
    halve(static_cast<int>(n), filled_);
  }
}

void MaskPyramid::copy(const Mask& mask) {
  Level& base = levels_.front();
  for (int y = 0; y < base.size.height; ++y) {
    const auto row = mask.row(y);
    std::memcpy(&base.any[static_cast<size_t>(y) * base.words_per_row], row.data(),
                row.size_bytes());
  }
}

void MaskPyramid::halve(int level, const Rect& box) {
  const Level& fine = levels_[level - 1];
  Level& coarse = levels_[level];
  const std::vector<uint32_t>& fine_all = level == 1 ? fine.any : fine.all;
  const int first_word = (box.x0 >> level) / kWordBits;
  const int last_word = ((box.x0 + box.width - 1) >> level) / kWordBits;
  const int last_y = (box.y0 + box.height - 1) >> level;
  for (int y = box.y0 >> level; y <= last_y; ++y) {
    // An odd last row stands for itself alone.
    const size_t upper = static_cast<size_t>(2 * y) * fine.words_per_row;
    const size_t lower =
        static_cast<size_t>(std::min(2 * y + 1, fine.size.height - 1)) * fine.words_per_row;
    for (int w = first_word; w <= last_word; ++w) {
      const auto pair = [&](const std::vector<uint32_t>& words, size_t row) {
        const uint32_t* two = &words[row] + 2 * w;
        return join(two[0], two[1]);
      };
      const uint64_t any = pair(fine.any, upper) | pair(fine.any, lower);
      const uint64_t all =
          (pair(fine_all, upper) & pair(fine_all, lower)) |
          join(beyond_end(2 * w, fine.size.width), beyond_end(2 * w + 1, fine.size.width));
      const size_t out = static_cast<size_t>(y) * coarse.words_per_row + w;
      coarse.any[out] = even_bits(any | any >> 1);
      coarse.all[out] = even_bits(all & all >> 1);
    }
  }
}

Coverage MaskPyramid::coverage(int x0, int y0, int x1, int y1) const {
  assert(0 <= x0 && x0 <= x1 && x1 < size().width && 0 <= y0 && y0 <= y1 && y1 < size().height);
  int n = 0;
  while ((x1 >> n) - (x0 >> n) >= kMaxCells || (y1 >> n) - (y0 >> n) >= kMaxCells) ++n;
  const Level& level = levels_[n];
  const std::vector<uint32_t>& level_all = n == 0 ? level.any : level.all;
  const int shift = (x0 >> n) % kWordBits;
  const uint32_t wanted = kAllOnes >> (kWordBits - 1 - ((x1 >> n) - (x0 >> n)));
  size_t at = static_cast<size_t>(y0 >> n) * level.words_per_row + (x0 >> n) / kWordBits;
  uint32_t any = 0;
  uint32_t all = wanted;
  for (int y = y0 >> n; y <= y1 >> n; ++y, at += level.words_per_row) {
    const auto cells = [&](const std::vector<uint32_t>& words) {
      return static_cast<uint32_t>(join(words[at], words[at + 1]) >> shift);
    };
    any |= cells(level.any) & wanted;
    all &= cells(level_all);
    if (any != 0 && all != wanted) return Coverage::kSome;
  }
  return any == 0 ? Coverage::kNone : Coverage::kAll;
}

}  // namespace v3d
