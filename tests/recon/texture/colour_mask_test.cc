#include "recon/texture/colour_mask.h"

#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

#include <algorithm>
#include <random>

namespace v3d::recon {
namespace {

/// Mostly foreground, so that pixels of every depth occur.
Mask random_mask(ImageSize size, uint32_t seed) {
  std::mt19937 random(seed);
  Mask mask(size);
  for (int y = 0; y < size.height; ++y) {
    for (int x = 0; x < size.width; ++x) {
      mask.set(x, y, random() % 8 != 0);
    }
  }
  return mask;
}

RC_GTEST_PROP(ColourMask, has_the_depth_of_every_pixel_in_its_silhouette, ()) {
  const ImageSize size{*rc::gen::inRange(1, 200), *rc::gen::inRange(1, 12)};
  Frame frame;
  frame.sensor_size = size;
  frame.mask = random_mask(size, *rc::gen::arbitrary<uint32_t>());
  const int x0 = *rc::gen::inRange(0, size.width), y0 = *rc::gen::inRange(0, size.height);
  frame.roi = {x0, y0, *rc::gen::inRange(1, size.width - x0 + 1),
               *rc::gen::inRange(1, size.height - y0 + 1)};
  const ColourMask found(frame);
  const auto at = [&](int x, int y) {
    return frame.mask->get(std::clamp(x, 0, size.width - 1), std::clamp(y, 0, size.height - 1));
  };
  for (int y = y0; y < y0 + frame.roi.height; ++y) {
    for (int x = x0; x < x0 + frame.roi.width; ++x) {
      const auto all = [&](int across, int down) {
        return at(x - across, y - down) && at(x + across, y - down) && at(x - across, y + down) &&
               at(x + across, y + down);
      };
      const bool inner = at(x, y) && all(2, 0) && all(0, 2);
      const bool deep = inner && all(5, 0) && all(0, 5) && all(4, 4);
      RC_ASSERT(found.depth(x, y) == (deep       ? PixelDepth::kDeep
                                      : inner    ? PixelDepth::kInner
                                      : at(x, y) ? PixelDepth::kRim
                                                 : PixelDepth::kOutside));
      RC_ASSERT(found.foreground(x, y) == at(x, y));
      RC_ASSERT(found.inner(x, y) == inner);
    }
  }
}

TEST(ColourMask, is_deep_everywhere_without_a_mask) {
  Frame frame;
  frame.sensor_size = {60, 8};
  frame.roi = {10, 2, 45, 5};
  const ColourMask mask(frame);
  EXPECT_EQ(mask.depth(10, 2), PixelDepth::kDeep);
  EXPECT_EQ(mask.depth(54, 6), PixelDepth::kDeep);
}

}  // namespace
}  // namespace v3d::recon
