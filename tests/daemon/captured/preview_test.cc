#include "daemon/captured/preview.h"

#include <gtest/gtest.h>

namespace v3d::captured {
namespace {

TEST(Preview, converts_a_quad_of_all_colours_to_one_pixel) {
  for (const PixelFormat format : {PixelFormat::kBayerRG8, PixelFormat::kBayerGR8,
                                   PixelFormat::kBayerGB8, PixelFormat::kBayerBG8}) {
    Image raw({6, 5}, format);  // the last row has no second row
    for (int y = 0; y < 5; ++y) {
      for (int x = 0; x < 6; ++x) {
        raw.row(y)[x] = static_cast<uint8_t>(50 * (bayer_channel(format, x, y) + 1));
      }
    }
    const Image small = preview_of(raw.view());
    ASSERT_EQ(small.size, (ImageSize{3, 2}));
    for (size_t i = 0; i < small.bytes.size(); ++i) EXPECT_EQ(small.bytes[i], 50 * (i % 3 + 1));
  }
}

TEST(Preview, averages_the_pixels_of_grey_and_rgb_images) {
  Image mono({2, 2}, PixelFormat::kMono8);
  mono.bytes = {10, 20, 30, 40};
  EXPECT_EQ(preview_of(mono.view()).bytes, (std::vector<uint8_t>{25, 25, 25}));
  Image rgb({2, 2}, PixelFormat::kRGB8);
  rgb.bytes = {0, 100, 200, 0, 100, 200, 40, 100, 200, 40, 100, 200};
  EXPECT_EQ(preview_of(rgb.view()).bytes, (std::vector<uint8_t>{20, 100, 200}));
}

TEST(Preview, keeps_a_single_pixel_of_the_mask) {
  Mask mask({8, 6});
  mask.set(5, 3);
  const Mask small = preview_mask(mask);
  EXPECT_EQ(small.size(), (ImageSize{4, 3}));
  EXPECT_TRUE(small.get(2, 1));
  EXPECT_EQ(small.count(), 1);
}

TEST(Preview, is_not_sent_of_an_image_with_a_single_row_or_column) {
  bus::Bus bus("udpm://239.255.76.67:7667?ttl=0");
  PreviewSender sender(bus, "cam01", 25);
  for (const ImageSize size : {ImageSize{640, 1}, ImageSize{1, 480}}) {
    sender.send(0, Image(size, PixelFormat::kMono8).view(), nullptr);
  }
}

}  // namespace

}  // namespace v3d::captured
