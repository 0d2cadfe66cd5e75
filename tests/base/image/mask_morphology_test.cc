#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

#include "base/image/mask_operations.h"

namespace v3d {
namespace {

Mask random_mask() {
  Mask mask({*rc::gen::inRange(1, 140), *rc::gen::inRange(1, 20)});
  const int density = *rc::gen::inRange(1, 9);
  for (int y = 0; y < mask.size().height; ++y) {
    for (int x = 0; x < mask.size().width; ++x) {
      if (*rc::gen::inRange(0, 10) < density) mask.set(x, y);
    }
  }
  return mask;
}

bool any_within(const Mask& mask, int x, int y, int radius, bool value) {
  for (int v = std::max(0, y - radius); v <= std::min(mask.size().height - 1, y + radius); ++v) {
    for (int u = std::max(0, x - radius); u <= std::min(mask.size().width - 1, x + radius); ++u) {
      if (mask.get(u, v) == value) return true;
    }
  }
  return false;
}

RC_GTEST_PROP(MaskShape, dilates_and_erodes_according_to_the_definition, ()) {
  const Mask mask = random_mask();
  const int radius = *rc::gen::inRange(0, 6);
  const Mask large = dilate(mask, radius);
  const Mask small = erode(mask, radius);
  for (int y = 0; y < mask.size().height; ++y) {
    for (int x = 0; x < mask.size().width; ++x) {
      RC_ASSERT(large.get(x, y) == any_within(mask, x, y, radius, true));
      RC_ASSERT(small.get(x, y) == !any_within(mask, x, y, radius, false));
    }
  }
  RC_ASSERT(intersection_of(mask, small) == small);
  RC_ASSERT(open(mask, radius) == dilate(small, radius));
}

TEST(MaskShape, computes_intersection_difference_and_union) {
  Mask a({70, 1});
  Mask b({70, 1});
  a.fill_row(0, 10, 68);
  b.fill_row(0, 60, 70);
  EXPECT_EQ(intersection_of(a, b).count(), 8);
  EXPECT_EQ(difference_of(a, b).count(), 50);
  EXPECT_EQ(union_of(a, b).count(), 60);
}

TEST(MaskShape, opening_removes_narrow_parts) {
  Mask mask({100, 100});
  for (int y = 20; y < 60; ++y) mask.fill_row(y, 20, 60);
  Mask with_hair = mask;
  for (int y = 60; y < 90; ++y) with_hair.fill_row(y, 40, 43);
  EXPECT_EQ(open(with_hair, 2), mask);
}

}  // namespace
}  // namespace v3d
