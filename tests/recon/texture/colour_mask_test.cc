#include "recon/texture/colour_mask.h"

#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

#include <algorithm>
#include <random>

#include "base/image/mask_operations.h"

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

/// A frame with a random mask and a random roi.
Frame random_frame() {
  const ImageSize size{*rc::gen::inRange(1, 200), *rc::gen::inRange(1, 12)};
  Frame frame;
  frame.sensor_size = size;
  frame.mask = random_mask(size, *rc::gen::arbitrary<uint32_t>());
  const int x0 = *rc::gen::inRange(0, size.width), y0 = *rc::gen::inRange(0, size.height);
  frame.roi = {x0, y0, *rc::gen::inRange(1, size.width - x0 + 1),
               *rc::gen::inRange(1, size.height - y0 + 1)};
  return frame;
}

/// `differing`: the pixels of the mask that differ from the background.
void check(const Frame& frame, const Mask& differing) {
  const ColourMask found(frame);
  const Mask deep = erode(*frame.mask, ColourMask::kLooseReach);
  const Rect roi = frame.roi;
  const auto at = [&](int x, int y) {
    const ImageSize size = differing.size();
    return differing.get(std::clamp(x, 0, size.width - 1), std::clamp(y, 0, size.height - 1));
  };
  for (int y = roi.y0; y < roi.y0 + roi.height; ++y) {
    for (int x = roi.x0; x < roi.x0 + roi.width; ++x) {
      const bool foreground = at(x, y) || deep.get(x, y);
      RC_ASSERT(found.foreground(x, y) == foreground);
      RC_ASSERT(found.background_like(x, y) == (frame.mask->get(x, y) && !foreground));
      RC_ASSERT(found.inner(x, y) ==
                (at(x, y) && at(x - 2, y) && at(x + 2, y) && at(x, y - 2) && at(x, y + 2)));
    }
  }
}

RC_GTEST_PROP(ColourMask, classifies_foreground_and_pixels_two_steps_inside, ()) {
  const Frame frame = random_frame();
  check(frame, *frame.mask);
}

RC_GTEST_PROP(ColourMask, has_inside_only_pixels_that_differ_from_the_background, ()) {
  Frame frame = random_frame();
  frame.background_difference = random_mask(frame.sensor_size, *rc::gen::arbitrary<uint32_t>());
  check(frame, intersection_of(*frame.mask, *frame.background_difference));
}

TEST(ColourMask, finds_background_like_pixels_only_near_the_outline) {
  Frame frame;
  frame.sensor_size = {100, 60};
  frame.roi = {0, 0, 100, 60};
  frame.mask = Mask(frame.sensor_size);
  frame.background_difference = Mask(frame.sensor_size);
  for (int y = 0; y < 60; ++y) frame.mask->fill_row(y, 0, 50);
  const ColourMask mask(frame);
  for (int x = 0; x < 100; ++x) {
    EXPECT_EQ(mask.background_like(x, 30), x >= 50 - ColourMask::kLooseReach && x < 50) << x;
    EXPECT_EQ(mask.foreground(x, 30), x < 50 - ColourMask::kLooseReach) << x;
    EXPECT_FALSE(mask.inner(x, 30)) << x;
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
