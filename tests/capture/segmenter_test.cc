#include "capture/segmentation/segmenter.h"

#include <gtest/gtest.h>

#include <functional>

#include "base/core/error.h"
#include "capture/segmentation/image_measures.h"
#include "studio_wall.h"
#include "support/allocation_count.h"
#include "support/instruction_sets.h"

namespace v3d::capture {
namespace {

constexpr ImageSize kSize{200, 150};
constexpr Rect kBody{60, 30, 70, 90};

/// A scene that shows `inside` where `shape` is true, and otherwise the wall.
Scene in_front(const std::function<bool(int, int)>& shape, const Scene& inside) {
  return [=](int x, int y) { return shape(x, y) ? inside(x, y) : wall(x, y); };
}
bool in_body(int x, int y) { return kBody.contains(x, y); }
Colour red_cloth(int, int) { return {160, 60, 60}; }
Scene dimmed(double factor) {
  return [=](int x, int y) {
    const Colour c = wall(x, y);
    return Colour{factor * c[0], factor * c[1], factor * c[2]};
  };
}

Mask mask_of(const std::function<bool(int, int)>& shape) {
  Mask mask(kSize);
  for (int y = 0; y < kSize.height; ++y) {
    for (int x = 0; x < kSize.width; ++x) {
      if (shape(x, y)) mask.set(x, y);
    }
  }
  return mask;
}

std::string format_name(const testing::TestParamInfo<PixelFormat>& format) {
  return std::string(name(format.param));
}

/// Tests for every pixel format.
class SegmenterTest : public testing::TestWithParam<PixelFormat> {
 protected:
  Mask segment(const Scene& scene, unsigned seed = 1) {
    return segmenter_.segment(photograph(kSize, GetParam(), scene, seed).view());
  }
  const segmentation::BackgroundModel model_ = learn_wall(kSize, GetParam());
  segmentation::Segmenter segmenter_{model_, {}};
};

INSTANTIATE_TEST_SUITE_P(Formats, SegmenterTest,
                         testing::Values(PixelFormat::kMono8, PixelFormat::kBayerRG8,
                                         PixelFormat::kBayerGR8, PixelFormat::kBayerGB8,
                                         PixelFormat::kBayerBG8, PixelFormat::kRGB8),
                         format_name);

TEST_P(SegmenterTest, finds_nothing_in_the_empty_studio) {
  for (unsigned seed = 1; seed <= 20; ++seed) EXPECT_EQ(segment(wall, seed).count(), 0) << seed;
}

TEST_P(SegmenterTest, finds_the_body_to_the_pixel) {
  const Mask mask = segment(in_front(in_body, [](int, int) { return Colour{220, 200, 220}; }));
  EXPECT_GT(intersection_over_union(mask, mask_of(in_body)), 0.995);
}

TEST_P(SegmenterTest, keeps_a_sword_of_three_pixels_whole) {
  const auto sword = [](int x, int y) {
    return x >= 20 && x < 180 && std::abs(y - 40 - x / 4) <= 1;
  };
  const Mask mask = segment(in_front(sword, [](int, int) { return Colour{210, 210, 220}; }));
  EXPECT_GT(intersection_over_union(mask, mask_of(sword)), 0.9);
  EXPECT_EQ(mask.bounding_box().width, 160);
}

TEST_P(SegmenterTest, compensates_flickering_lamps) {
  for (const double brightness : {0.85, 0.97, 1.04, 1.15}) {
    EXPECT_EQ(segment(dimmed(brightness)).count(), 0) << brightness;
    const auto performer = [&](int x, int y) {
      return in_body(x, y) ? Colour{220, 200, 220} : dimmed(brightness)(x, y);
    };
    EXPECT_GT(intersection_over_union(segment(performer), mask_of(in_body)), 0.98) << brightness;
  }
}

TEST_P(SegmenterTest, limits_the_expected_value_of_a_white_wall_to_the_sample_range) {
  const auto half_white = [](double brightness) {
    return [=](int x, int y) {
      const Colour c = x < 100 ? wall(x, y) : Colour{236, 240, 232};
      return Colour{brightness * c[0], brightness * c[1], brightness * c[2]};
    };
  };
  segmentation::Segmenter segmenter(learn_scene(kSize, GetParam(), half_white(1)), {});
  const Scene brighter = half_white(1.15);
  EXPECT_EQ(segmenter.segment(photograph(kSize, GetParam(), brighter, 1).view()).count(), 0);
  const Scene performer = [&](int x, int y) {
    return in_body(x, y) ? Colour{150, 120, 180} : brighter(x, y);
  };
  const Mask mask = segmenter.segment(photograph(kSize, GetParam(), performer, 1).view());
  EXPECT_GT(intersection_over_union(mask, mask_of(in_body)), 0.95);
}

TEST_P(SegmenterTest, drops_specks_and_fills_pinholes) {
  const auto speck = [](int x, int y) { return x >= 20 && x < 26 && y >= 20 && y < 26; };
  EXPECT_EQ(segment(in_front(speck, red_cloth)).count(), 0);
  const auto pierced = [](int x, int y) {
    return in_body(x, y) && !(x >= 90 && x < 97 && y >= 60 && y < 67);
  };
  const Mask mask = segment(in_front(pierced, [](int, int) { return Colour{220, 200, 220}; }));
  EXPECT_TRUE(mask.get(93, 63));
  EXPECT_GT(intersection_over_union(mask, mask_of(in_body)), 0.995);
}

TEST_P(SegmenterTest, gives_the_same_mask_again_and_from_another_segmenter) {
  const Image first = photograph(kSize, GetParam(), in_front(in_body, red_cloth), 5);
  const Image second = photograph(kSize, GetParam(), wall, 6);
  const Mask mask = segmenter_.segment(first.view());
  segmenter_.segment(second.view());
  EXPECT_EQ(segmenter_.segment(first.view()), mask);
  segmentation::Segmenter other(model_, {});
  EXPECT_EQ(other.segment(first.view()), mask);
}

TEST_P(SegmenterTest, gives_the_same_mask_on_every_instruction_set) {
  const auto half_shaded = [](int x, int y) {
    return in_body(x, y) ? Colour{160, 60, 60} : dimmed(x > 100 ? 0.7 : 1.0)(x, y);
  };
  const Image image = photograph(kSize, GetParam(), half_shaded, 3, 4.0);
  const Mask mask = segmenter_.segment(image.view());
  EXPECT_GT(mask.count(), 1000);
  on_every_instruction_set([&] {
    const Mask again = segmenter_.segment(image.view());
    EXPECT_EQ(again, mask);
  });
}

TEST_P(SegmenterTest, allocates_nothing_but_the_mask) {
  const Image image = photograph(kSize, GetParam(), in_front(in_body, red_cloth), 5);
  Mask mask = segmenter_.segment(image.view());
  const int64_t before = test::allocations();
  mask = segmenter_.segment(image.view());
  EXPECT_EQ(test::allocations() - before, 1);
}

class ColourSegmenterTest : public SegmenterTest {};
INSTANTIATE_TEST_SUITE_P(Formats, ColourSegmenterTest,
                         testing::Values(PixelFormat::kBayerRG8, PixelFormat::kRGB8), format_name);

TEST_P(ColourSegmenterTest, classifies_a_shadow_as_background) {
  for (const double light : {0.6, 0.7, 0.85}) {
    const Mask mask = segment(in_front(in_body, dimmed(light)));
    EXPECT_LT(mask.count(), 0.03 * mask_of(in_body).count()) << light;
  }
}

TEST_P(ColourSegmenterTest, classifies_a_small_highlight_as_background) {
  const Mask mask = segment(in_front(in_body, dimmed(1.1)));
  EXPECT_LT(mask.count(), 0.03 * mask_of(in_body).count());
}

TEST_P(ColourSegmenterTest, classifies_pixels_too_dark_for_a_shadow_as_foreground) {
  const Mask mask = segment(in_front(in_body, dimmed(0.35)));
  EXPECT_GT(intersection_over_union(mask, mask_of(in_body)), 0.97);
}

TEST_P(ColourSegmenterTest, finds_a_colour_as_bright_as_the_wall) {
  const Mask mask = segment(in_front(in_body, red_cloth));
  EXPECT_GT(intersection_over_union(mask, mask_of(in_body)), 0.98);
}

TEST(Segmenter, returns_an_empty_mask_for_images_of_one_row_or_column) {
  for (const ImageSize size : {ImageSize{1, 10}, ImageSize{10, 1}, ImageSize{1, 1}}) {
    segmentation::BackgroundModel model{size, PixelFormat::kMono8, {}, {}};
    model.mean.assign(size.pixels(), 100);
    model.spread.assign(size.pixels(), 1);
    segmentation::Segmenter segmenter(model, {});
    EXPECT_EQ(segmenter.segment(Image(size, PixelFormat::kMono8).view()).count(), 0);
  }
}

TEST(Segmenter, accepts_widths_that_are_no_multiple_of_a_word) {
  for (const int width : {2, 3, 63, 64, 65, 127, 128, 129}) {
    const ImageSize size{width, 40};
    segmentation::BackgroundModel model{size, PixelFormat::kMono8, {}, {}};
    model.mean.assign(size.pixels(), 100);
    model.spread.assign(size.pixels(), 1);
    segmentation::SegmentOptions options;
    options.min_area = 0;
    segmentation::Segmenter segmenter(model, options);
    Image image(size, PixelFormat::kMono8);
    for (int y = 0; y < size.height; ++y) {
      for (int x = 0; x < width; ++x) image.row(y)[x] = y < 9 ? 250 : 100;
    }
    const Mask mask = segmenter.segment(image.view());
    EXPECT_EQ(mask.bounding_box(), (Rect{0, 0, width, 9})) << width;
  }
}

TEST(LearnBackground, computes_mean_and_spread) {
  const Image dark = photograph(
      {64, 64}, PixelFormat::kMono8,
      [](int, int) {
        return Colour{98, 98, 98};
      },
      1, 0);
  const Image light = photograph(
      {64, 64}, PixelFormat::kMono8,
      [](int, int) {
        return Colour{98, 98, 98};
      },
      1, 0);
  Image speck = light;
  speck.row(10)[10] = 101;
  const segmentation::BackgroundModel model =
      segmentation::learn_background({dark.view(), light.view(), speck.view()});
  EXPECT_NEAR(model.mean[0], 98, 0.01);
  EXPECT_NEAR(model.spread[0], 0, 0.01);
  EXPECT_NEAR(model.mean[10 * 64 + 10], 99, 0.01);
  EXPECT_NEAR(model.spread[10 * 64 + 10], std::sqrt(3.0), 0.01);
}

TEST(LearnBackground, does_not_count_flicker_as_noise) {
  std::vector<Image> plates;
  for (int i = 0; i < 10; ++i) {
    plates.push_back(photograph(kSize, PixelFormat::kMono8, dimmed(0.95 + 0.01 * i), i, 1));
  }
  std::vector<ImageView> views;
  for (const Image& plate : plates) views.push_back(plate.view());
  const segmentation::BackgroundModel model = segmentation::learn_background(views);
  double sum = 0;
  for (const float s : model.spread) sum += s;
  EXPECT_LT(sum / static_cast<double>(model.spread.size()), 1.5);
}

TEST(LearnBackground, rejects_plates_of_different_size_or_format) {
  const Image a(kSize, PixelFormat::kMono8);
  const Image b({100, 150}, PixelFormat::kMono8);
  const Image c(kSize, PixelFormat::kBayerRG8);
  EXPECT_THROW(segmentation::learn_background({}), InputError);
  EXPECT_THROW(segmentation::learn_background({a.view()}), InputError);
  EXPECT_THROW(segmentation::learn_background({a.view(), b.view()}), InputError);
  EXPECT_THROW(segmentation::learn_background({a.view(), c.view()}), InputError);
  ImageView cut = a.view();
  cut.bytes = cut.bytes.first(100);
  EXPECT_THROW(segmentation::learn_background({a.view(), cut}), InputError);
}

TEST(Brightness, is_the_ratio_of_most_samples) {
  const std::vector<uint16_t> mean(kSize.pixels(), 100 * 256);
  const auto picture = [](int x, int) {
    return x < 80 ? Colour{10, 10, 10} : Colour{120, 120, 120};
  };
  const Image image = photograph(kSize, PixelFormat::kMono8, picture, 3);
  EXPECT_NEAR(segmentation::brightness_ratio(image.view(), mean) / double(segmentation::kUnitGain),
              1.2, 0.01);
}

TEST(Brightness, is_one_for_an_image_without_usable_samples) {
  const std::vector<uint16_t> dark(kSize.pixels(), 3 * 256);
  EXPECT_EQ(segmentation::brightness_ratio(Image(kSize, PixelFormat::kMono8).view(), dark),
            segmentation::kUnitGain);
}

}  // namespace
}  // namespace v3d::capture
