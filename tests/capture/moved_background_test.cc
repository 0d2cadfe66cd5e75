
#include <gtest/gtest.h>

#include "capture/segmentation/image_measures.h"
#include "capture/segmentation/segmenter.h"
#include "studio_wall.h"

namespace v3d::capture {
namespace {

constexpr ImageSize kSize{200, 150};
constexpr Rect kLamp{140, 10, 40, 12};
constexpr Rect kBody{60, 40, 50, 90};
constexpr int kCarpet = 25;  // x of its edge, pixels

/// The wall with a carpet in front of it and a lamp, both displaced by so many pixels.
Scene room(int moved_x, int moved_y) {
  return [=](int x, int y) {
    if (x < kCarpet + moved_x && y > 60) return Colour{60, 55, 110};
    if (kLamp.contains(x - moved_x, y - moved_y)) return Colour{230, 240, 235};
    return wall(x, y);
  };
}

Scene with(const Rect& place, const Colour& colour, const Scene& behind) {
  return [=](int x, int y) { return place.contains(x, y) ? colour : behind(x, y); };
}

Mask mask_of(const Rect& place) {
  Mask mask(kSize);
  for (int y = place.y0; y < place.y0 + place.height; ++y) {
    mask.fill_row(y, place.x0, place.x0 + place.width);
  }
  return mask;
}

class MovedBackground : public testing::TestWithParam<PixelFormat> {
 protected:
  Mask segment(const Scene& scene, int reach = segmentation::SegmentOptions{}.moved) const {
    segmentation::SegmentOptions options;
    options.moved = reach;
    return segmentation::Segmenter(model_, options)
        .segment(photograph(kSize, GetParam(), scene, 1).view());
  }
  segmentation::BackgroundModel model_ = learn_scene(kSize, GetParam(), room(0, 0));
};

INSTANTIATE_TEST_SUITE_P(Formats, MovedBackground,
                         testing::Values(PixelFormat::kMono8, PixelFormat::kBayerRG8,
                                         PixelFormat::kBayerGB8, PixelFormat::kRGB8),
                         [](const auto& format) { return std::string(name(format.param)); });

TEST_P(MovedBackground, is_foreground_only_without_a_search_radius) {
  for (const int moved : {-4, -3, 3, 4}) {
    const Scene scene = room(moved, moved);
    EXPECT_GT(segment(scene, 0).count(), 300) << moved;
    EXPECT_EQ(segment(scene).count(), 0) << moved;
  }
}

TEST_P(MovedBackground, is_foreground_if_it_moved_far) {
  EXPECT_GT(segment(room(12, 12)).count(), 500);
}

TEST_P(MovedBackground, is_detected_under_dimmed_lamps) {
  const Scene dimmed = [moved = room(3, 3)](int x, int y) {
    const Colour c = moved(x, y);
    return Colour{0.85 * c[0], 0.85 * c[1], 0.85 * c[2]};
  };
  EXPECT_GT(segment(dimmed, 0).count(), 300);
  EXPECT_EQ(segment(dimmed).count(), 0);
}

TEST_P(MovedBackground, is_detected_if_the_lamp_saturates) {
  const auto brighter = [](int moved) {
    return [=](int x, int y) {
      const Colour c = room(moved, moved)(x, y);
      return Colour{1.4 * c[0], 1.4 * c[1], 1.4 * c[2]};
    };
  };
  EXPECT_GT(segment(brighter(4), 0).count(), 300);
  EXPECT_EQ(segment(brighter(4)).count(), 0);
}

TEST_P(MovedBackground, is_compared_with_samples_of_the_same_colour) {
  const Scene green = [](int, int) { return Colour{80, 140, 80}; };
  model_ = learn_scene(kSize, GetParam(), green);
  const Mask mask = segment(with(kBody, {140, 80, 140}, green));
  EXPECT_GT(intersection_over_union(mask, mask_of(kBody)), 0.99);
}

TEST_P(MovedBackground, keeps_the_performer_to_the_pixel) {
  const Mask mask = segment(with(kBody, {220, 200, 220}, room(3, 3)));
  EXPECT_GT(intersection_over_union(mask, mask_of(kBody)), 0.99);
}

TEST_P(MovedBackground, keeps_a_performer_beside_it_in_its_colours) {
  const Rect beside{kCarpet - 10, 70, 40, 60};  // more than half is not in front of the carpet
  const Mask mask = segment(with(beside, {60, 55, 110}, room(0, 0)));
  EXPECT_GE(mask.count(), 25 * 60 * 9 / 10);
}

TEST_P(MovedBackground, keeps_a_blade_in_front_of_its_edge) {
  const Rect blade{kCarpet - 1, 65, 3, 60};
  const Mask mask = segment(with(blade, {215, 225, 225}, room(0, 0)));
  EXPECT_GT(intersection_over_union(mask, mask_of(blade)), 0.8);
}

TEST(MovedBackgroundPieces, are_tested_one_by_one_up_to_the_corners_of_the_image) {
  const Image image(kSize, PixelFormat::kMono8);  // black; the model is black but for one column
  segmentation::BackgroundModel model{kSize, PixelFormat::kMono8, {}, {}};
  model.mean.assign(kSize.pixels(), 0);
  model.spread.assign(kSize.pixels(), 2);
  for (int y = 0; y < kSize.height; ++y)
    model.mean[static_cast<size_t>(y) * kSize.width + 100] = 100;
  segmentation::SegmentOptions options;
  options.shake = 0;
  const segmentation::BackgroundTable table(model, options);
  Mask mask = mask_of({0, 0, 3, 3});
  for (int y = 147; y < 150; ++y) mask.fill_row(y, 197, 200);
  for (int y = 70; y < 80; ++y) mask.fill_row(y, 100, 101);
  MaskComponents pieces;
  pieces.find(mask);
  ASSERT_EQ(pieces.count(), 3U);
  const segmentation::ExpectedBackground background{table, segmentation::kUnitGain, 1000};
  const auto moved = [&](size_t piece, int reach) {
    return is_moved_background(pieces, piece, image.view(), background, reach);
  };
  // The column (the second piece) is one pixel wide, so a quad never matches its own place. Only a
  // search finds the black beside it.
  for (const size_t corner : {0U, 2U}) EXPECT_TRUE(moved(corner, 0)) << corner;
  EXPECT_FALSE(moved(1, 0));
  EXPECT_TRUE(moved(1, 2));
}

}  // namespace
}  // namespace v3d::capture
