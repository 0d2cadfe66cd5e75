#include <gtest/gtest.h>

#include <Eigen/Core>
#include <algorithm>
#include <random>

#include "recon/visibility/surface_camera.h"

namespace v3d::recon {
namespace {

constexpr ImageSize kSize{40, 30};
/// Even corner, as of every roi.
constexpr Rect kRoi{6, 4, 22, 18};

Frame frame_of(const Image& whole) {
  Frame frame;
  frame.camera = "cam01";
  frame.sensor_size = whole.size;
  frame.roi = kRoi;
  frame.image = crop(whole.view(), kRoi);
  return frame;
}

Image noise(PixelFormat format) {
  std::mt19937 random(11);
  Image image(kSize, format);
  for (uint8_t& byte : image.bytes) byte = static_cast<uint8_t>(random());
  return image;
}

/// A mosaic of one colour.
Image mosaic_of(PixelFormat format, const std::array<uint8_t, 3>& rgb) {
  Image image(kSize, format);
  for (int y = 0; y < kSize.height; ++y) {
    for (int x = 0; x < kSize.width; ++x) image.row(y)[x] = rgb[bayer_channel(format, x, y)];
  }
  return image;
}

/// Of a pixel of the lattice.
int brightness(const Luminance& picture, int x, int y) {
  return static_cast<int>(picture.quads()[static_cast<size_t>(y) * picture.width() + x] & 255);
}

/// The lattice pixel of the camera's pixel (x, y).
Eigen::Vector2i place_of(const Luminance& picture, double x, double y) {
  return {static_cast<int>(std::lround((x + 0.5) * picture.scale() - picture.first_u())),
          static_cast<int>(std::lround((y + 0.5) * picture.scale() - picture.first_v()))};
}

TEST(Luminance, of_grey_is_the_pixels_with_a_border_that_repeats_the_edge) {
  const Image whole = noise(PixelFormat::kMono8);
  const Luminance picture(frame_of(whole));
  ASSERT_EQ(picture.width(), kRoi.width + 2 * Luminance::kBorder);
  ASSERT_EQ(picture.height(), kRoi.height + 2 * Luminance::kBorder);
  for (int y = -3; y < kSize.height + 3; ++y) {
    for (int x = -3; x < kSize.width + 3; ++x) {
      const Eigen::Vector2i at = place_of(picture, x, y);
      const int cx = std::clamp(x, kRoi.x0, kRoi.x0 + kRoi.width - 1);
      const int cy = std::clamp(y, kRoi.y0, kRoi.y0 + kRoi.height - 1);
      EXPECT_EQ(brightness(picture, at.x(), at.y()), whole.row(cy)[cx]) << x << " " << y;
    }
  }
}

TEST(Luminance, holds_four_neighbouring_pixels_in_each_quad) {
  const Luminance picture(frame_of(noise(PixelFormat::kMono8)));
  for (int y = 0; y + 1 < picture.height(); ++y) {
    for (int x = 0; x + 1 < picture.width(); ++x) {
      const uint32_t quad = picture.quads()[static_cast<size_t>(y) * picture.width() + x];
      EXPECT_EQ(static_cast<int>(quad >> 8 & 255), brightness(picture, x + 1, y));
      EXPECT_EQ(static_cast<int>(quad >> 16 & 255), brightness(picture, x, y + 1));
      EXPECT_EQ(static_cast<int>(quad >> 24), brightness(picture, x + 1, y + 1));
    }
  }
}

TEST(Luminance, of_colours_counts_green_twice) {
  const Image whole = noise(PixelFormat::kRGB8);
  const Luminance picture(frame_of(whole));
  for (int y = kRoi.y0; y < kRoi.y0 + kRoi.height; ++y) {
    for (int x = kRoi.x0; x < kRoi.x0 + kRoi.width; ++x) {
      const uint8_t* rgb = whole.row(y) + static_cast<ptrdiff_t>(3) * x;
      const Eigen::Vector2i at = place_of(picture, x, y);
      EXPECT_EQ(brightness(picture, at.x(), at.y()), (rgb[0] + 2 * rgb[1] + rgb[2] + 2) / 4);
    }
  }
}

TEST(Luminance, of_a_mosaic_of_one_colour_shows_no_pattern_up_to_the_edge) {
  for (const PixelFormat format : {PixelFormat::kBayerGR8, PixelFormat::kBayerRG8,
                                   PixelFormat::kBayerGB8, PixelFormat::kBayerBG8}) {
    const Luminance picture(frame_of(mosaic_of(format, {200, 40, 120})));
    for (int y = 0; y < picture.height(); ++y) {
      for (int x = 0; x < picture.width(); ++x) {
        ASSERT_EQ(brightness(picture, x, y), (200 + 2 * 40 + 120) / 4) << name(format);
      }
    }
  }
}

TEST(Luminance, halved_is_the_mean_of_two_by_two_pixels_at_the_same_place_of_the_camera) {
  const Image whole = noise(PixelFormat::kMono8);
  const Luminance half = Luminance(frame_of(whole)).halved();
  EXPECT_EQ(half.scale(), 0.5F);
  for (int y = kRoi.y0; y < kRoi.y0 + kRoi.height; y += 2) {
    for (int x = kRoi.x0; x < kRoi.x0 + kRoi.width; x += 2) {
      const int sum =
          whole.row(y)[x] + whole.row(y)[x + 1] + whole.row(y + 1)[x] + whole.row(y + 1)[x + 1];
      const Eigen::Vector2i at = place_of(half, x + 0.5, y + 0.5);
      EXPECT_EQ(brightness(half, at.x(), at.y()), (sum + 2) / 4) << x << " " << y;
    }
  }
  EXPECT_EQ(half.halved().scale(), 0.25F);
}

}  // namespace
}  // namespace v3d::recon
