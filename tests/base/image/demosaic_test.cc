#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>

#include "base/image/colour.h"

namespace v3d {
namespace {

constexpr std::array kBayer = {PixelFormat::kBayerGR8, PixelFormat::kBayerRG8,
                               PixelFormat::kBayerGB8, PixelFormat::kBayerBG8};

/// `colour(x, y)` is an array of three numbers.
template <class Colour>
Image picture(ImageSize size, Colour&& colour) {
  Image rgb(size, PixelFormat::kRGB8);
  for (int y = 0; y < size.height; ++y) {
    for (int x = 0; x < size.width; ++x) {
      const auto c = colour(x, y);
      std::transform(c.begin(), c.end(), rgb.row(y) + 3 * x,
                     [](double grey) { return static_cast<uint8_t>(std::lround(grey)); });
    }
  }
  return rgb;
}

TEST(Mosaic, keeps_the_sample_of_the_filter_colour_of_each_pixel) {
  const Image rgb = picture({5, 4}, [](int x, int y) {
    return std::array{10.0 * x + y, 60.0 + 10 * x + y, 120.0 + 10 * x + y};
  });
  for (const PixelFormat format : kBayer) {
    const Image raw = mosaic(rgb.view(), format);
    for (int y = 0; y < 4; ++y) {
      for (int x = 0; x < 5; ++x) {
        ASSERT_EQ(raw.row(y)[x], 60 * bayer_channel(format, x, y) + 10 * x + y) << name(format);
      }
    }
  }
}

TEST(ToRgb, reproduces_a_uniform_scene_from_every_bayer_pattern_up_to_the_border) {
  const Image scene = picture({6, 5}, [](int, int) { return std::array{200.0, 120.0, 40.0}; });
  for (const PixelFormat format : kBayer) {
    EXPECT_EQ(to_rgb(mosaic(scene.view(), format).view()).bytes, scene.bytes) << name(format);
  }
}

TEST(ToRgb, reproduces_linear_gradients_away_from_the_border) {
  const Image scene = picture({20, 18}, [](int x, int y) {
    return std::array{20.0 + 8 * x, 200.0 - 4 * x - 4 * y, 40.0 + 8 * y};
  });
  for (const PixelFormat format : kBayer) {
    const Image rgb = to_rgb(mosaic(scene.view(), format).view());
    for (int y = 2; y < 16; ++y) {
      for (int i = 3 * 2; i < 3 * 18; ++i) {
        ASSERT_EQ(rgb.row(y)[i], scene.row(y)[i]) << name(format) << " row " << y << " byte " << i;
      }
    }
  }
}

TEST(ToRgb, keeps_every_measured_sample) {
  Image raw({7, 6}, PixelFormat::kBayerGB8);
  for (size_t i = 0; i < raw.bytes.size(); ++i) raw.bytes[i] = static_cast<uint8_t>(i * 73);
  EXPECT_EQ(mosaic(to_rgb(raw.view()).view(), raw.format).bytes, raw.bytes);
}

TEST(ToRgb, reproduces_fine_grey_stripes_without_the_false_colours_of_bilinear_interpolation) {
  // Stripes with a period of five pixels. Bilinear interpolation of each colour has a mean error of
  // 16.9 grey values.
  const Image scene = picture({60, 50}, [](int x, int y) {
    const double grey = 128 + 90 * std::sin(2 * 3.14159265 / 5 * (0.96 * x + 0.28 * y));
    return std::array{grey, grey, grey};
  });
  for (const PixelFormat format : kBayer) {
    const Image rgb = to_rgb(mosaic(scene.view(), format).view());
    double sum = 0;
    for (size_t i = 0; i < rgb.bytes.size(); ++i) sum += std::abs(rgb.bytes[i] - scene.bytes[i]);
    EXPECT_LT(sum / static_cast<double>(rgb.bytes.size()), 6) << name(format);
  }
}

TEST(ToRgb, copies_grey_to_three_channels_and_keeps_rgb) {
  Image grey({2, 1}, PixelFormat::kMono8);
  grey.bytes = {7, 200};
  const std::vector<uint8_t> tripled = {7, 7, 7, 200, 200, 200};
  EXPECT_EQ(to_rgb(grey.view()).bytes, tripled);
  EXPECT_EQ(to_rgb(to_rgb(grey.view()).view()).bytes, tripled);
}

TEST(ToRgb, accepts_images_smaller_than_its_filters) {
  for (const ImageSize size : {ImageSize{0, 0}, ImageSize{1, 1}, ImageSize{2, 1}, ImageSize{1, 3},
                               ImageSize{2, 2}, ImageSize{3, 2}}) {
    for (const PixelFormat format :
         {PixelFormat::kBayerRG8, PixelFormat::kMono8, PixelFormat::kRGB8}) {
      const Image raw(size, format);
      EXPECT_EQ(to_rgb(raw.view()).bytes, std::vector<uint8_t>(size.pixels() * 3));
    }
  }
}

}  // namespace
}  // namespace v3d
