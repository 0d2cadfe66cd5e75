#include "base/image/image.h"

#include <gtest/gtest.h>

#include <string_view>
#include <vector>

namespace v3d {
namespace {

constexpr PixelFormat kAll[] = {
    PixelFormat::kMono8,     PixelFormat::kBayerGR8,  PixelFormat::kBayerRG8,
    PixelFormat::kBayerGB8,  PixelFormat::kBayerBG8,  PixelFormat::kRGB8,
    PixelFormat::kMono10,    PixelFormat::kMono12,    PixelFormat::kBayerGR10,
    PixelFormat::kBayerRG10, PixelFormat::kBayerGB10, PixelFormat::kBayerBG10,
    PixelFormat::kBayerGR12, PixelFormat::kBayerRG12, PixelFormat::kBayerGB12,
    PixelFormat::kBayerBG12};

TEST(PixelFormat, is_found_by_name_and_code) {
  for (const PixelFormat format : kAll) {
    EXPECT_EQ(pixel_format_from_name(name(format)), format);
    EXPECT_EQ(pixel_format_from_code(static_cast<uint32_t>(format)), format);
  }
  EXPECT_FALSE(pixel_format_from_name("BayerRG14"));
  EXPECT_FALSE(pixel_format_from_code(0));
}

TEST(PixelFormat, has_a_format_of_8_bits_with_the_same_colours) {
  for (const PixelFormat format : kAll) {
    const PixelFormat reduced = reduced_to_8_bits(format);
    EXPECT_EQ(bits_per_sample(reduced), 8) << name(format);
    EXPECT_EQ(is_bayer(reduced), is_bayer(format)) << name(format);
    if (!is_bayer(format)) continue;
    EXPECT_EQ(bayer_channel(reduced, 1, 1), bayer_channel(format, 1, 1)) << name(format);
    EXPECT_EQ(name(reduced).substr(0, 7), name(format).substr(0, 7));
  }
}

TEST(ReduceTo8Bits, keeps_the_upper_bits_of_each_sample) {
  Image image({2, 2}, PixelFormat::kBayerRG12);
  image.bytes = {0xff, 0x0f, 0x0f, 0x00, 0x50, 0x04, 0x00, 0x10};  // 4095, 15, 1104, 4096
  reduce_to_8_bits(image);
  EXPECT_EQ(image.format, PixelFormat::kBayerRG8);
  EXPECT_EQ(image.bytes, (std::vector<uint8_t>{255, 0, 69, 255}))
      << "a value above 12 bits is white";
  Image ten({2, 1}, PixelFormat::kMono10);
  ten.bytes = {0x07, 0x00, 0xfc, 0x03};  // 7, 1020
  reduce_to_8_bits(ten);
  EXPECT_EQ(ten.bytes, (std::vector<uint8_t>{1, 255}));
}

TEST(ReduceTo8Bits, leaves_an_image_of_8_bits_as_it_is) {
  Image image({2, 1}, PixelFormat::kRGB8);
  image.bytes = {1, 2, 3, 4, 5, 6};
  const uint8_t* const data = image.bytes.data();
  reduce_to_8_bits(image);
  EXPECT_EQ(image.format, PixelFormat::kRGB8);
  EXPECT_EQ(image.bytes.data(), data);
  EXPECT_EQ(image.bytes.size(), 6U);
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
