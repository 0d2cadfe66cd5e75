
#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

#include <cmath>
#include <random>

#include "base/image/mask_operations.h"
#include "capture/segmentation/mask_cleanup.h"

namespace v3d::capture {
namespace {

constexpr ImageSize kSize{330, 250};

/// A figure with straight edges in many directions and round ones.
Mask figure() {
  Mask mask(kSize);
  for (int y = 0; y < kSize.height; ++y) {
    for (int x = 0; x < kSize.width; ++x) {
      const bool body = std::hypot((x - 100) / 60.0, (y - 120) / 90.0) < 1;
      const bool arm = x > 100 && x < 300 && std::abs(y - 60 - 0.37 * (x - 100)) < 14;
      const bool leg = y > 120 && y < 240 && std::abs(x - 70 - 0.13 * (y - 120)) < 12;
      if (body || arm || leg) mask.set(x, y);
    }
  }
  return mask;
}

bool happens(std::mt19937& random, double part) {
  return static_cast<double>(random()) < part * 4294967296.0;
}

Mask frayed(Mask mask, double part, unsigned seed) {
  std::mt19937 random(seed);
  const Mask core = erode(mask, 1);
  for (int y = 0; y < mask.size().height; ++y) {
    for (int x = 0; x < mask.size().width; ++x) {
      if (mask.get(x, y) && !core.get(x, y) && happens(random, part)) mask.set(x, y, false);
    }
  }
  return mask;
}

Mask salted(Mask mask, double part, unsigned seed) {
  std::mt19937 random(seed);
  for (int y = 0; y < mask.size().height; ++y) {
    for (int x = 0; x < mask.size().width; ++x) {
      if (happens(random, part)) mask.set(x, y, !mask.get(x, y));
    }
  }
  return mask;
}

Mask smooth(Mask mask) {
  segmentation::filter_majority(mask);
  return mask;
}

Mask cleaned(Mask mask) {
  segmentation::MaskCleanup().clean(mask, segmentation::SegmentOptions());
  return mask;
}

bool get(const Mask& mask, int x, int y) {
  return x >= 0 && y >= 0 && x < mask.size().width && y < mask.size().height && mask.get(x, y);
}

/// True if the background pixel lies in a notch along (dx, dy), as mask_cleanup.h defines it.
/// (inx, iny) is the direction to the foreground.
bool is_in_notch(const Mask& mask, int x, int y, int dx, int dy, int inx, int iny) {
  int ends[2];
  for (const int side : {0, 1}) {
    const int sign = side == 0 ? -1 : 1;
    int n = 0;
    while (n <= 8 && !get(mask, x + sign * n * dx, y + sign * n * dy)) {
      if (!get(mask, x + sign * n * dx + inx, y + sign * n * dy + iny)) return false;
      ++n;
    }
    ends[side] = n;
  }
  return ends[0] + ends[1] - 1 <= 8;
}

Mask notches_filled(const Mask& mask) {
  static constexpr int kInward[4][2] = {{0, 1}, {0, -1}, {1, 0}, {-1, 0}};
  Mask filled = mask;
  for (int y = 0; y < mask.size().height; ++y) {
    for (int x = 0; x < mask.size().width; ++x) {
      for (const auto& [inx, iny] : kInward) {
        const int dx = std::abs(iny), dy = std::abs(inx);
        if (is_in_notch(mask, x, y, dx, dy, inx, iny) ||
            is_in_notch(mask, x, y, dx + inx, dy + iny, inx, iny) ||
            is_in_notch(mask, x, y, dx - inx, dy - iny, inx, iny)) {
          filled.set(x, y);
        }
      }
    }
  }
  return filled;
}

Mask specks_filled(const Mask& mask) {
  Mask filled = mask;
  for (int y = 0; y < mask.size().height; ++y) {
    for (int x = 0; x < mask.size().width; ++x) {
      int neighbours = 0;
      for (int v = -1; v <= 1; ++v) {
        for (int u = -1; u <= 1; ++u) neighbours += (u != 0 || v != 0) && get(mask, x + u, y + v);
      }
      if (neighbours >= 7) filled.set(x, y);
    }
  }
  return filled;
}

Mask bumps_levelled(const Mask& mask) {
  static constexpr int kInward[4][2] = {{0, 1}, {0, -1}, {1, 0}, {-1, 0}};
  Mask flat = mask;
  for (int y = 0; y < mask.size().height; ++y) {
    for (int x = 0; x < mask.size().width; ++x) {
      for (const auto& [inx, iny] : kInward) {
        const int dx = std::abs(iny), dy = std::abs(inx);
        int length = 0;
        while (length <= 2 && get(mask, x + length * dx, y + length * dy) &&
               get(mask, x + length * dx + inx, y + length * dy + iny) &&
               !get(mask, x + length * dx - inx, y + length * dy - iny)) {
          ++length;
        }
        if (length < 1 || length > 2 || get(mask, x - dx, y - dy)) continue;
        if (get(mask, x + length * dx, y + length * dy)) continue;
        for (int n = 0; n < length; ++n) flat.set(x + n * dx, y + n * dy, false);
      }
    }
  }
  return flat;
}

TEST(FrayedOutline, regains_most_lost_pixels_and_gains_few_others) {
  const Mask whole = figure();
  for (const unsigned seed : {1U, 2U, 3U}) {
    const Mask torn = frayed(whole, 0.5, seed);
    const Mask repaired = cleaned(torn);
    const auto lost = difference_of(whole, smooth(torn)).count();
    EXPECT_LT(difference_of(whole, repaired).count(), lost / 2);
    EXPECT_LT(difference_of(repaired, whole).count(), lost / 20);
  }
}

TEST(FrayedOutline, is_detected_unlike_a_clean_one_or_5_percent_noise) {
  const Mask whole = figure();
  EXPECT_FALSE(segmentation::is_frayed(whole, smooth(whole)));
  for (const unsigned seed : {1U, 2U, 3U}) {
    const Mask noisy = salted(whole, 0.05, seed);
    EXPECT_FALSE(segmentation::is_frayed(noisy, cleaned(noisy)));
    const Mask torn = frayed(whole, 0.5, seed);
    EXPECT_TRUE(segmentation::is_frayed(torn, smooth(torn)));
    const Mask torn_and_noisy = salted(torn, 0.05, seed + 10);
    EXPECT_TRUE(segmentation::is_frayed(torn_and_noisy, smooth(torn_and_noisy)));
  }
  EXPECT_FALSE(segmentation::is_frayed(Mask(kSize), Mask(kSize)));
}

TEST(FrayedOutline, repair_keeps_a_thin_gap_between_two_limbs_open) {
  for (const int width : {2, 3, 4, 6}) {
    Mask whole = figure();
    Mask gap(kSize);
    for (int y = 60; y < 150; ++y) gap.fill_row(y, 90, 90 + width);
    whole = difference_of(whole, gap);
    const Mask torn = frayed(whole, 0.5, 5);
    ASSERT_TRUE(segmentation::is_frayed(torn, smooth(torn)));
    const Mask repaired = cleaned(torn);
    for (int y = 66; y < 144; ++y) {
      int open = 0;
      for (int x = 90; x < 90 + width; ++x) open += !repaired.get(x, y);
      EXPECT_GT(open, 0) << width << " pixels wide, row " << y;
    }
  }
}

TEST(FrayedOutline, repair_keeps_a_thin_object_beside_it) {
  Mask torn = frayed(figure(), 0.5, 6);
  for (int y = 60; y < 140; ++y) torn.fill_row(y, 310, 312);
  ASSERT_TRUE(segmentation::is_frayed(torn, smooth(torn)));
  const Mask repaired = cleaned(torn);
  for (int y = 62; y < 138; ++y) {
    EXPECT_TRUE(repaired.get(310, y) && repaired.get(311, y)) << y;
    EXPECT_FALSE(repaired.get(309, y) || repaired.get(312, y)) << y;
  }
}

RC_GTEST_PROP(FrayedOutline, repair_equals_a_pixel_by_pixel_implementation, ()) {
  const ImageSize size{*rc::gen::inRange(1, 200), *rc::gen::inRange(1, 30)};
  const unsigned seed = *rc::gen::arbitrary<unsigned>();
  Mask solid(size);
  for (int y = size.height / 4; y < size.height; ++y) {
    solid.fill_row(y, size.width / 5, size.width - size.width / 6);
  }
  const Mask raw = salted(solid, *rc::gen::inRange(0, 40) * 0.01, seed);
  const Mask outline = smooth(raw);
  const Mask near = intersection_of(raw, dilate(outline, 2));
  RC_ASSERT(segmentation::without_notches(raw, outline) ==
            bumps_levelled(notches_filled(specks_filled(near))));
}

}  // namespace
}  // namespace v3d::capture
