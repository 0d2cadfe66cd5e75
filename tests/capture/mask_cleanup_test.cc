#include "capture/segmentation/mask_cleanup.h"

#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

#include <algorithm>
#include <random>
#include <vector>

#include "base/image/mask_operations.h"

namespace v3d::capture {
namespace {

Mask random_mask(ImageSize size, double density, unsigned seed) {
  std::mt19937 random(seed);
  std::bernoulli_distribution set(density);
  Mask mask(size);
  for (int y = 0; y < size.height; ++y) {
    for (int x = 0; x < size.width; ++x) {
      if (set(random)) mask.set(x, y);
    }
  }
  return mask;
}

/// Random mask of any size, also not a multiple of 64, and any density.
Mask any_mask() {
  const ImageSize size{*rc::gen::inRange(1, 200), *rc::gen::inRange(1, 40)};
  return random_mask(size, *rc::gen::inRange(0, 101) * 0.01, *rc::gen::arbitrary<unsigned>());
}

void drop_small_pieces(Mask& mask, int min_area, MaskComponents& pieces) {
  pieces.find(mask);
  for (size_t i = 0; i < pieces.count(); ++i) {
    if (pieces.area(i) < min_area) pieces.drop(i, mask);
  }
}

/// A pixel of the mask. Border pixels are repeated outside the mask.
bool get(const Mask& mask, int x, int y) {
  return mask.get(std::clamp(x, 0, mask.size().width - 1),
                  std::clamp(y, 0, mask.size().height - 1));
}

/// For each pixel, the area of its connected piece of `value` (0 elsewhere), by flood fill. With
/// `border_is_endless` pieces that touch the border have a very large area.
std::vector<int64_t> areas(const Mask& mask, bool value, bool diagonal, bool border_is_endless) {
  const ImageSize size = mask.size();
  std::vector<int64_t> area(size.pixels());
  std::vector<char> seen(size.pixels());
  for (int start = 0; start < size.pixels(); ++start) {
    if (seen[start] || mask.get(start % size.width, start / size.width) != value) continue;
    std::vector<int> piece{start};
    seen[start] = 1;
    bool endless = false;
    for (size_t i = 0; i < piece.size(); ++i) {
      const int x = piece[i] % size.width;
      const int y = piece[i] / size.width;
      endless |= x == 0 || y == 0 || x == size.width - 1 || y == size.height - 1;
      for (int dy = -1; dy <= 1; ++dy) {
        for (int dx = -1; dx <= 1; ++dx) {
          const int u = x + dx;
          const int v = y + dy;
          if (u < 0 || v < 0 || u >= size.width || v >= size.height) continue;
          if ((dx != 0 && dy != 0 && !diagonal) || seen[v * size.width + u]) continue;
          if (mask.get(u, v) != value) continue;
          seen[v * size.width + u] = 1;
          piece.push_back(v * size.width + u);
        }
      }
    }
    const bool ignore = endless && border_is_endless;
    for (const int pixel : piece) {
      area[pixel] = ignore ? int64_t{1} << 30 : static_cast<int64_t>(piece.size());
    }
  }
  return area;
}

RC_GTEST_PROP(MaskCleanup, majority_equals_a_count_of_pixels, ()) {
  const Mask before = any_mask();
  Mask after = before;
  segmentation::filter_majority(after);
  Mask expected(before.size());
  for (int y = 0; y < before.size().height; ++y) {
    for (int x = 0; x < before.size().width; ++x) {
      int count = 0;
      for (int v = y - 1; v <= y + 1; ++v) {
        for (int u = x - 1; u <= x + 1; ++u) count += get(before, u, v);
      }
      if (count >= 5) expected.set(x, y);
    }
  }
  RC_ASSERT(after == expected);
}

RC_GTEST_PROP(MaskCleanup, drops_exactly_the_small_pieces_of_a_flood_fill, ()) {
  const Mask before = any_mask();
  const int min_area = *rc::gen::inRange(0, 60);
  const auto area = areas(before, true, true, false);
  Mask expected(before.size());
  for (int i = 0; i < before.size().pixels(); ++i) {
    const bool keep = area[i] > 0 && area[i] >= min_area;
    if (keep) expected.set(i % before.size().width, i / before.size().width);
  }
  Mask after = before;
  MaskComponents pieces;
  drop_small_pieces(after, min_area, pieces);
  RC_ASSERT(after == expected);
  // The remaining runs must be those of the remaining pieces.
  Mask left(before.size());
  for (const Run& run : pieces.runs()) left.fill_row(run.y, run.begin, run.end);
  RC_ASSERT(left == expected);
}

RC_GTEST_PROP(MaskCleanup, fills_exactly_the_small_holes_of_a_flood_fill, ()) {
  const Mask before = any_mask();
  const int max_hole = *rc::gen::inRange(0, 60);
  const auto area = areas(before, false, false, true);
  Mask expected = before;
  for (int i = 0; i < before.size().pixels(); ++i) {
    const bool fill = area[i] > 0 && area[i] < max_hole;
    if (fill) expected.set(i % before.size().width, i / before.size().width);
  }
  Mask after = before;
  MaskComponents pieces;
  pieces.find(before);
  segmentation::MaskHoles().fill_small(after, pieces.runs(), max_hole);
  RC_ASSERT(after == expected);
}

RC_GTEST_PROP(MaskCleanup, fills_holes_of_the_remaining_pieces_without_state_of_other_masks, ()) {
  MaskComponents pieces;
  segmentation::MaskHoles holes;
  for (int i = 0; i < 3; ++i) {
    Mask mask = any_mask();
    drop_small_pieces(mask, 20, pieces);
    Mask expected = mask;
    holes.fill_small(mask, pieces.runs(), 30);
    MaskComponents fresh;
    fresh.find(expected);
    segmentation::MaskHoles().fill_small(expected, fresh.runs(), 30);
    RC_ASSERT(mask == expected);
  }
}

TEST(MaskCleanup, majority_keeps_a_line_of_two_pixels) {
  Mask mask({100, 20});
  mask.fill_row(8, 0, 100);
  mask.fill_row(9, 0, 100);
  const Mask before = mask;
  segmentation::filter_majority(mask);
  EXPECT_EQ(mask, before);
}

TEST(MaskCleanup, accepts_an_empty_mask) {
  Mask mask;
  segmentation::filter_majority(mask);
  MaskComponents pieces;
  drop_small_pieces(mask, 10, pieces);
  segmentation::MaskHoles().fill_small(mask, pieces.runs(), 10);
  EXPECT_EQ(mask.count(), 0);
}

}  // namespace
}  // namespace v3d::capture
