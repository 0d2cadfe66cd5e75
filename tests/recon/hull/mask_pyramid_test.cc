#include "recon/hull/mask_pyramid.h"

#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

#include <algorithm>

#include "tests/recon/random_rig.h"

namespace v3d::recon {
namespace {

struct Span {
  int first, last;
};

Span random_span(int size) {
  const int a = uniform_int(0, size);
  const int b = uniform_int(0, size);
  return {std::min(a, b), std::max(a, b)};
}

MaskCoverage exact_coverage(const Mask& mask, Span x, Span y) {
  int64_t foreground = 0;
  for (int v = y.first; v <= y.last; ++v) {
    for (int u = x.first; u <= x.last; ++u) foreground += mask.get(u, v);
  }
  const int64_t pixels = int64_t{x.last - x.first + 1} * (y.last - y.first + 1);
  return foreground == 0        ? MaskCoverage::kNone
         : foreground == pixels ? MaskCoverage::kAll
                                : MaskCoverage::kSome;
}

RC_GTEST_PROP(MaskPyramid, is_never_wrong_when_it_is_certain, ()) {
  const ImageSize size{uniform_int(1, 300), uniform_int(1, 300)};
  MaskPyramid pyramid(size);
  pyramid.build(random_mask(size));  // the remains of an earlier frame must have no effect
  const Mask mask = random_mask(size);
  pyramid.build(mask);
  for (int n = 0; n < 50; ++n) {
    const Span x = random_span(size.width);
    const Span y = random_span(size.height);
    const MaskCoverage truth = exact_coverage(mask, x, y);
    const MaskCoverage found = pyramid.coverage(x.first, y.first, x.last, y.last);
    RC_ASSERT(found == truth || found == MaskCoverage::kSome);
  }
}

RC_GTEST_PROP(MaskPyramid, is_exact_for_small_rectangles, ()) {
  const ImageSize size{uniform_int(1, 300), uniform_int(1, 300)};
  const Mask mask = random_mask(size);
  MaskPyramid pyramid(size);
  pyramid.build(mask);
  for (int n = 0; n < 50; ++n) {
    Span x = random_span(size.width);
    Span y = random_span(size.height);
    x.last = std::min(x.last, x.first + 31);
    y.last = std::min(y.last, y.first + 31);
    RC_ASSERT(pyramid.coverage(x.first, y.first, x.last, y.last) == exact_coverage(mask, x, y));
  }
}

TEST(MaskPyramid, handles_full_images_whose_sides_are_not_powers_of_two) {
  for (const ImageSize size : {ImageSize{1, 1}, {1023, 3}, {65, 517}, {1024, 768}, {333, 97}}) {
    Mask mask(size);
    MaskPyramid pyramid(size);
    pyramid.build(mask);
    EXPECT_EQ(pyramid.coverage(0, 0, size.width - 1, size.height - 1), MaskCoverage::kNone);
    for (int y = 0; y < size.height; ++y) mask.fill_row(y, 0, size.width);
    pyramid.build(mask);
    EXPECT_EQ(pyramid.coverage(0, 0, size.width - 1, size.height - 1), MaskCoverage::kAll);
    mask.set(size.width - 1, size.height - 1, false);
    pyramid.build(mask);
    EXPECT_NE(pyramid.coverage(0, 0, size.width - 1, size.height - 1), MaskCoverage::kAll);
  }
}

TEST(MaskPyramid, is_independent_of_the_previous_mask) {
  Mask mask({1024, 768});
  MaskPyramid pyramid(mask.size());
  for (int y = 0; y < 768; ++y) mask.fill_row(y, 0, 1024);
  pyramid.build(mask);
  Mask left_half(mask.size());
  for (int y = 0; y < 768; ++y) left_half.fill_row(y, 0, 512);
  pyramid.build(left_half);
  EXPECT_EQ(pyramid.coverage(0, 0, 1023, 767), MaskCoverage::kSome);
  pyramid.build(Mask(mask.size()));
  EXPECT_EQ(pyramid.coverage(0, 0, 1023, 767), MaskCoverage::kNone);
}

TEST(MaskPyramid, handles_an_odd_last_row) {
  Mask mask({100, 3});
  mask.fill_row(2, 0, 100);
  MaskPyramid pyramid(mask.size());
  pyramid.build(mask);
  EXPECT_EQ(pyramid.coverage(0, 2, 63, 2), MaskCoverage::kAll);
}

TEST(MaskPyramid, finds_a_single_pixel_and_nothing_away_from_it) {
  Mask mask({1024, 768});
  mask.set(700, 500);
  MaskPyramid pyramid(mask.size());
  pyramid.build(mask);
  EXPECT_EQ(pyramid.coverage(0, 0, 600, 767), MaskCoverage::kNone);
  EXPECT_EQ(pyramid.coverage(0, 0, 1023, 767), MaskCoverage::kSome);
  EXPECT_EQ(pyramid.coverage(700, 500, 700, 500), MaskCoverage::kAll);
}

}  // namespace
}  // namespace v3d::recon
