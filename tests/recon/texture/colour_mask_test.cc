#include "recon/texture/colour_mask.h"

#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

#include <algorithm>
#include <random>

namespace v3d::recon {
namespace {

/// Mostly foreground: a third of the pixels are `inner`.
Mask random_mask(ImageSize size, uint32_t seed) {
  std::mt19937 random(seed);
  Mask mask(size);
  for (int y = 0; y < size.height; ++y) {
    for (int x = 0; x < size.width; ++x) {
      mask.set(x, y, random() % 5 != 0);
    }
  }
  return mask;
}

RC_GTEST_PROP(ColourMask, tells_foreground_and_what_is_two_steps_inside_it, ()) {
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
      RC_ASSERT(found.foreground(x, y) == at(x, y));
      RC_ASSERT(found.inner(x, y) ==
                (at(x, y) && at(x - 2, y) && at(x + 2, y) && at(x, y - 2) && at(x, y + 2)));
    }
  }
}

TEST(ColourMask, is_foreground_everywhere_without_a_mask) {
  Frame frame;
  frame.sensor_size = {60, 8};
  frame.roi = {10, 2, 45, 5};
  const ColourMask mask(frame);
  EXPECT_TRUE(mask.foreground(10, 2) && mask.inner(10, 2));
  EXPECT_TRUE(mask.foreground(54, 6) && mask.inner(54, 6));
}

}  // namespace
}  // namespace v3d::recon
