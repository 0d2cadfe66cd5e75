#include "capture/cameras/pixel_decoder.h"

#include <arv.h>
#include <gtest/gtest.h>
#include <linux/videodev2.h>

#include <array>
#include <cmath>
#include <cstdlib>
#include <string>
#include <vector>

#include "base/image/image_files.h"

namespace v3d::capture {
namespace {

using Bytes = std::vector<uint8_t>;

SentLayout layout_of(const char* name, ImageSize size, size_t padding = 0) {
  const CameraFormat format = camera_format_from_name(name).value();
  return {format, size, row_bytes(format, size.width) + padding};
}

std::vector<int> samples_of(const Image& image) {
  std::vector<int> samples;
  for (size_t i = 0; i + 1 < image.bytes.size(); i += 2) {
    samples.push_back(image.bytes[i] | image.bytes[i + 1] << 8);
  }
  return samples;
}

std::vector<int> decoded(const char* name, ImageSize size, const Bytes& bytes) {
  const auto image = decode_image(layout_of(name, size), bytes);
  return image ? samples_of(*image) : std::vector<int>{};
}

TEST(CameraFormat, has_the_codes_of_the_headers_of_aravis_and_v4l2) {
  const auto pfnc = [](const char* name) {
    return pfnc_code(camera_format_from_name(name).value()).value_or(0);
  };
  EXPECT_EQ(pfnc("Mono10Packed"), ARV_PIXEL_FORMAT_MONO_10_PACKED);
  EXPECT_EQ(pfnc("Mono12Packed"), ARV_PIXEL_FORMAT_MONO_12_PACKED);
  EXPECT_EQ(pfnc("BayerGR10Packed"), ARV_PIXEL_FORMAT_BAYER_GR_10_PACKED);
  EXPECT_EQ(pfnc("BayerRG12Packed"), ARV_PIXEL_FORMAT_BAYER_RG_12_PACKED);
  EXPECT_EQ(pfnc("BayerGB12p"), ARV_PIXEL_FORMAT_BAYER_GB_12P);
  EXPECT_EQ(pfnc("BayerBG10p"), ARV_PIXEL_FORMAT_BAYER_BG_10P);
  EXPECT_EQ(pfnc("BayerRG10"), ARV_PIXEL_FORMAT_BAYER_RG_10);
  EXPECT_EQ(pfnc("BayerBG12"), ARV_PIXEL_FORMAT_BAYER_BG_12);
  EXPECT_EQ(pfnc("MJPEG"), 0U);
  const auto v4l2 = [](const char* name) {
    return fourcc_of(camera_format_from_name(name).value()).value_or(0);
  };
  EXPECT_EQ(v4l2("Mono8"), V4L2_PIX_FMT_GREY);
  EXPECT_EQ(v4l2("BayerBG8"), V4L2_PIX_FMT_SBGGR8);
  EXPECT_EQ(v4l2("Mono10"), V4L2_PIX_FMT_Y10);
  EXPECT_EQ(v4l2("Mono12"), V4L2_PIX_FMT_Y12);
  EXPECT_EQ(v4l2("Mono10MSB"), V4L2_PIX_FMT_Y10BPACK);
  EXPECT_EQ(v4l2("Mono10MIPI"), V4L2_PIX_FMT_Y10P);
  EXPECT_EQ(v4l2("BayerGR10"), V4L2_PIX_FMT_SGRBG10);
  EXPECT_EQ(v4l2("BayerRG12"), V4L2_PIX_FMT_SRGGB12);
  EXPECT_EQ(v4l2("BayerGR10MIPI"), V4L2_PIX_FMT_SGRBG10P);
  EXPECT_EQ(v4l2("BayerGB12MIPI"), V4L2_PIX_FMT_SGBRG12P);
  EXPECT_EQ(v4l2("MJPEG"), V4L2_PIX_FMT_MJPEG);
  EXPECT_EQ(v4l2("NV12"), V4L2_PIX_FMT_NV12);
  EXPECT_EQ(v4l2("BayerRG10p"), 0U) << "V4L2 packs in the layout of MIPI";
  EXPECT_FALSE(camera_format_from_name("BayerRG14"));
}

TEST(PixelDecoder, unpacks_the_layouts_of_10_bits) {
  const std::vector<int> samples = {0x3ff, 0x001, 0x2a5, 0x0f0};
  EXPECT_EQ(decoded("Mono10p", {4, 1}, {0xff, 0x07, 0x50, 0x2a, 0x3c}), samples);
  EXPECT_EQ(decoded("Mono10Packed", {4, 1}, {0xff, 0x13, 0x00, 0xa9, 0x01, 0x3c}), samples);
  EXPECT_EQ(decoded("Mono10MIPI", {4, 1}, {0xff, 0x00, 0xa9, 0x3c, 0x17}), samples);
  EXPECT_EQ(decoded("Mono10MSB", {4, 1}, {0xff, 0xc0, 0x1a, 0x94, 0xf0}), samples);
  EXPECT_EQ(decoded("Mono10", {4, 1}, {0xff, 0x03, 0x01, 0x00, 0xa5, 0x02, 0xf0, 0x00}), samples);
}

TEST(PixelDecoder, unpacks_the_layouts_of_12_bits) {
  const std::vector<int> samples = {0xabc, 0x123};
  EXPECT_EQ(decoded("BayerRG12p", {2, 1}, {0xbc, 0x3a, 0x12}), samples);
  EXPECT_EQ(decoded("BayerRG12Packed", {2, 1}, {0xab, 0x3c, 0x12}), samples);
  EXPECT_EQ(decoded("BayerRG12MIPI", {2, 1}, {0xab, 0x12, 0x3c}), samples);
  EXPECT_EQ(decoded("BayerRG12", {2, 1}, {0xbc, 0x0a, 0x23, 0x01}), samples);
}

TEST(PixelDecoder, skips_the_padding_of_rows) {
  const Bytes bytes = {0xab, 0x3c, 0x12, 99, 99, 0xff, 0x0f, 0x00};
  const auto image = decode_image(layout_of("BayerRG12Packed", {2, 2}, 2), bytes);
  ASSERT_TRUE(image);
  EXPECT_EQ(image->format, PixelFormat::kBayerRG12);
  EXPECT_EQ(samples_of(*image), (std::vector<int>{0xabc, 0x123, 0xfff, 0}));
}

TEST(PixelDecoder, rejects_an_image_with_a_missing_byte_in_every_format) {
  for (const char* name : {"Mono8", "RGB8", "Mono10", "BayerRG12p", "BayerRG10Packed",
                           "BayerGR10MIPI", "Mono10MSB", "YUYV", "UYVY", "NV12"}) {
    const SentLayout layout = layout_of(name, {4, 4}, 3);
    EXPECT_TRUE(decode_image(layout, Bytes(layout.byte_count()))) << name;
    EXPECT_FALSE(decode_image(layout, Bytes(layout.byte_count() - 1))) << name;
  }
}

/// Equal colours up to the rounding of libyuv.
void expect_colour(const Image& image, int x, int y, std::array<int, 3> rgb) {
  for (int c = 0; c < 3; ++c) {
    EXPECT_LE(std::abs(image.row(y)[3 * x + c] - rgb[c]), 3)
        << "channel " << c << " at " << x << ", " << y << ": " << int{image.row(y)[3 * x + c]};
  }
}

TEST(PixelDecoder, converts_yuv_to_rgb_by_the_matrix_and_range_of_the_driver) {
  // BT.601, 16 to 235: red is Y 81, U 90, V 240; white is 235, 128, 128.
  SentLayout layout = layout_of("YUYV", {2, 1});
  auto image = decode_image(layout, Bytes{81, 90, 235, 240});
  ASSERT_TRUE(image);
  EXPECT_EQ(image->format, PixelFormat::kRGB8);
  expect_colour(*image, 0, 0, {254, 0, 0});
  image = decode_image(layout_of("UYVY", {2, 1}), Bytes{90, 81, 240, 81});
  expect_colour(*image, 1, 0, {254, 0, 0});
  // BT.601, 0 to 255 (JPEG): red is 76, 85, 255.
  layout.coding = {.is_full_range = true};
  expect_colour(*decode_image(layout, Bytes{76, 85, 76, 255}), 0, 0, {254, 0, 0});
  // BT.709, 16 to 235: red is 63, 102, 240.
  layout.coding = {.is_bt709 = true};
  expect_colour(*decode_image(layout, Bytes{63, 102, 63, 240}), 0, 0, {255, 1, 0});
}

TEST(PixelDecoder, takes_the_chroma_of_nv12_from_the_second_plane) {
  SentLayout layout = layout_of("NV12", {4, 2}, 1);
  layout.coding = {.is_full_range = true};
  const Bytes bytes = {76, 76, 29, 29, 0, 76, 76, 29, 29, 0, 85, 255, 255, 107};
  const auto image = decode_image(layout, bytes);
  ASSERT_TRUE(image);
  for (const int y : {0, 1}) {
    expect_colour(*image, 0, y, {254, 0, 0});
    expect_colour(*image, 3, y, {0, 0, 254});
  }
}

Image gradient(ImageSize size) {
  Image rgb(size, PixelFormat::kRGB8);
  for (size_t i = 0; i < rgb.bytes.size(); ++i) rgb.bytes[i] = static_cast<uint8_t>(i / 3 % 200);
  return rgb;
}

/// The JPEG without its Huffman tables, as many USB cameras send Motion JPEG.
Bytes without_huffman_tables(const Bytes& jpeg) {
  Bytes result(jpeg.begin(), jpeg.begin() + 2);
  size_t at = 2;
  while (jpeg[at + 1] != 0xda) {
    const size_t length = 2 + (jpeg[at + 2] << 8 | jpeg[at + 3]);
    if (jpeg[at + 1] != 0xc4) result.insert(result.end(), &jpeg[at], &jpeg[at] + length);
    at += length;
  }
  result.insert(result.end(), jpeg.begin() + static_cast<std::ptrdiff_t>(at), jpeg.end());
  return result;
}

TEST(PixelDecoder, decodes_motion_jpeg_without_huffman_tables) {
  const Image rgb = gradient({32, 16});
  const Bytes jpeg = encode_jpeg(rgb.view(), 95);
  const Bytes motion = without_huffman_tables(jpeg);
  ASSERT_LT(motion.size(), jpeg.size());
  const SentLayout layout = layout_of("MJPEG", {32, 16});
  const auto image = decode_image(layout, motion);
  ASSERT_TRUE(image);
  EXPECT_EQ(image->bytes, decode_image(layout, jpeg)->bytes);
  EXPECT_NEAR(image->row(8)[3 * 16], rgb.row(8)[3 * 16], 12);
}

TEST(PixelDecoder, rejects_motion_jpeg_of_another_size_or_cut_off) {
  const Bytes jpeg = encode_jpeg(gradient({32, 16}).view(), 90);
  EXPECT_FALSE(decode_image(layout_of("MJPEG", {16, 16}), jpeg));
  const Bytes half(jpeg.begin(), jpeg.begin() + static_cast<std::ptrdiff_t>(jpeg.size() - 40));
  EXPECT_FALSE(decode_image(layout_of("MJPEG", {32, 16}), half));
  EXPECT_FALSE(decode_image(layout_of("MJPEG", {32, 16}), Bytes{}));
}

}  // namespace
}  // namespace v3d::capture
