#include "base/image/mask_morphology.h"

#include <algorithm>

#include "base/core/check.h"

namespace v3d {
namespace {

template <class F>
Mask word_by_word(Mask a, const Mask& b, F f) {
  V3D_CHECK(a.size() == b.size());
  for (int y = 0; y < a.size().height; ++y) {
    const auto row = a.row(y);
    std::transform(row.begin(), row.end(), b.row(y).begin(), row.begin(), f);
  }
  return a;
}

/// Dilates a row by `radius` columns. The result can have bits in its padding.
void grow_row(std::span<const uint64_t> row, std::span<uint64_t> result, int radius) {
  const auto word = [&](size_t w) { return w < row.size() ? row[w] : 0; };
  for (size_t w = 0; w < row.size(); ++w) {
    const uint64_t before = w > 0 ? row[w - 1] : 0;
    uint64_t grown = row[w];
    for (int i = 1; i <= radius; ++i) {
      grown |= row[w] << i | before >> (64 - i) | row[w] >> i | word(w + 1) << (64 - i);
    }
    result[w] = grown;
  }
}

void clear_padding(Mask& mask) {
  const int used = mask.size().width % 64;
  if (used == 0) return;
  for (int y = 0; y < mask.size().height; ++y) mask.row(y).back() &= (uint64_t{1} << used) - 1;
}

Mask inverse(Mask mask) {
  for (int y = 0; y < mask.size().height; ++y) {
    for (uint64_t& word : mask.row(y)) word = ~word;
  }
  clear_padding(mask);
  return mask;
}

Mask grown_along_rows(const Mask& mask, int radius) {
  Mask result(mask.size());
  for (int y = 0; y < mask.size().height; ++y) grow_row(mask.row(y), result.row(y), radius);
  clear_padding(result);
  return result;
}

Mask grown_along_columns(const Mask& mask, int radius) {
  Mask result(mask.size());
  const int height = mask.size().height;
  for (int y = 0; y < height; ++y) {
    const auto row = result.row(y);
    for (int from = std::max(0, y - radius); from <= std::min(height - 1, y + radius); ++from) {
      std::transform(row.begin(), row.end(), mask.row(from).begin(), row.begin(),
                     [](uint64_t a, uint64_t b) { return a | b; });
    }
  }
  return result;
}

}  // namespace

Mask intersection_of(Mask a, const Mask& b) {
  return word_by_word(std::move(a), b, [](uint64_t x, uint64_t y) { return x & y; });
}
Mask difference_of(Mask a, const Mask& b) {
  return word_by_word(std::move(a), b, [](uint64_t x, uint64_t y) { return x & ~y; });
}
Mask union_of(Mask a, const Mask& b) {
  return word_by_word(std::move(a), b, [](uint64_t x, uint64_t y) { return x | y; });
}

Mask dilate(const Mask& mask, int radius) {
  V3D_CHECK(radius >= 0 && radius <= kMaxRadius);
  return grown_along_columns(grown_along_rows(mask, radius), radius);
}

Mask erode(const Mask& mask, int radius) { return inverse(dilate(inverse(mask), radius)); }

Mask open(const Mask& mask, int radius) { return dilate(erode(mask, radius), radius); }

}  // namespace v3d
