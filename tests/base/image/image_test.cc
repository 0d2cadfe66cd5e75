#include "base/image/image.h"

#include <gtest/gtest.h>

#include <string_view>

namespace v3d {
namespace {

constexpr PixelFormat kAll[] = {PixelFormat::kMono8,    PixelFormat::kBayerGR8,
                                PixelFormat::kBayerRG8, PixelFormat::kBayerGB8,
                                PixelFormat::kBayerBG8, PixelFormat::kRGB8};

TEST(PixelFormat, is_found_by_name_code_and_fourcc) {
  for (const PixelFormat format : kAll) {
    EXPECT_EQ(pixel_format_from_name(name(format)), format);
    EXPECT_EQ(pixel_format_from_code(static_cast<uint32_t>(format)), format);
    EXPECT_EQ(pixel_format_from_fourcc(v4l2_fourcc(format)), format);
  }
  EXPECT_FALSE(pixel_format_from_name("BayerRG12"));
  EXPECT_FALSE(pixel_format_from_code(0));
  EXPECT_FALSE(pixel_format_from_fourcc(0));
}

TEST(PixelFormat, names_the_colours_of_the_first_two_pixels_of_a_bayer_image) {
  for (const PixelFormat format : kAll) {
    if (is_bayer(format)) {
      const std::string_view letters = name(format).substr(5, 2);
      EXPECT_EQ("RGB"[bayer_channel(format, 0, 0)], letters[0]) << name(format);
      EXPECT_EQ("RGB"[bayer_channel(format, 1, 0)], letters[1]) << name(format);
    }
  }
}

TEST(Crop, copies_whole_pixels_of_a_colour_image) {
  Image raw({5, 3}, PixelFormat::kRGB8);
  raw.row(1)[3 * 3 + 2] = 99;
  const Image part = crop(raw.view(), {3, 1, 2, 2});
  EXPECT_EQ(part.size, (ImageSize{2, 2}));
  EXPECT_EQ(part.row(0)[2], 99);
}

}  // namespace
}  // namespace v3d
