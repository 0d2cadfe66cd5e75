#include "capture/segmentation/mask_majority.h"

#include <algorithm>
#include <array>
#include <cstdint>
#include <utility>

#include "base/core/check.h"

namespace v3d {
namespace {

// Bit-sliced arithmetic on 64 pixels at a time: each bit of a number has its own word.

constexpr size_t kMaxWords = kMaxImageSide / 64;

/// The sum of three bits per pixel.
struct TwoBits {
  uint64_t ones = 0;
  uint64_t twos = 0;
};

TwoBits add(uint64_t a, uint64_t b, uint64_t c) { return {a ^ b ^ c, (a & b) | (c & (a ^ b))}; }

/// Bits of the pixels whose three numbers (0 to 3 each) add up to 5 or more.
uint64_t at_least_five(TwoBits a, TwoBits b, TwoBits c) {
  const TwoBits ones = add(a.ones, b.ones, c.ones);           // weighs 1, carry 2
  const TwoBits twos = add(a.twos, b.twos, c.twos);           // weighs 2, carry 4
  const uint64_t two = ones.twos ^ twos.ones;                 // weighs 2
  const uint64_t four = (ones.twos & twos.ones) ^ twos.twos;  // weighs 4
  const uint64_t eight = ones.twos & twos.ones & twos.twos;
  return eight | (four & (two | ones.ones));
}

/// For each pixel of a row: how many of it and its left and right neighbours are set (0 to 3).
struct CountedRow {
  bool empty;
  std::array<uint64_t, kMaxWords> ones, twos;

  TwoBits at(size_t w) const { return {ones[w], twos[w]}; }
};

/// Counts a row. `last` is the last bit of the row in its last word. The end pixels are repeated
/// beyond the row.
void count(std::span<const uint64_t> row, int last, CountedRow& counted) {
  const size_t words = row.size();
  counted.empty = std::all_of(row.begin(), row.end(), [](uint64_t w) { return w == 0; });
  std::array<uint64_t, kMaxWords + 2> longer;  // by a word at both ends
  std::copy(row.begin(), row.end(), longer.begin() + 1);
  longer[0] = row[0] << 63;
  const uint64_t end = row[words - 1] >> last & 1;
  longer[words] |= last == 63 ? 0 : end << (last + 1);
  longer[words + 1] = end;
  for (size_t w = 0; w < words; ++w) {
    const uint64_t here = longer[w + 1];
    const TwoBits sum = add(here << 1 | longer[w] >> 63, here, here >> 1 | longer[w + 2] << 63);
    counted.ones[w] = sum.ones;
    counted.twos[w] = sum.twos;
  }
}

}  // namespace

void take_majority(Mask& mask) {
  const int height = mask.size().height;
  const auto words = static_cast<size_t>(mask.words_per_row());
  if (height == 0 || words == 0) return;
  V3D_CHECK(words <= kMaxWords);
  const int last = (mask.size().width - 1) % 64;
  CountedRow rows[3];
  CountedRow* above = &rows[0];
  CountedRow* here = &rows[1];
  CountedRow* below = &rows[2];
  count(mask.row(0), last, *here);
  count(mask.row(0), last, *above);
  for (int y = 0; y < height; ++y) {
    // The row below is still unmodified. Beyond the last row, that row is repeated.
    if (y + 1 < height) {
      count(mask.row(y + 1), last, *below);
    } else {
      *below = *here;
    }
    if (!above->empty || !here->empty || !below->empty) {
      const auto row = mask.row(y);
      for (size_t w = 0; w < words; ++w) {
        row[w] = at_least_five(above->at(w), here->at(w), below->at(w));
      }
      row[words - 1] &= ~uint64_t{0} >> (63 - last);
    }
    std::swap(above, here);
    std::swap(here, below);
  }
}

}  // namespace v3d
