#include <gtest/gtest.h>

#include <cstdlib>

#include "base/image/image_files.h"

namespace v3d {
namespace {

/// A smooth gradient, which JPEG changes little.
Image gradient(ImageSize size) {
  Image image(size, PixelFormat::kRGB8);
  for (int y = 0; y < size.height; ++y) {
    for (int x = 0; x < size.width; ++x) {
      image.row(y)[3 * x] = static_cast<uint8_t>(2 * x);
      image.row(y)[3 * x + 1] = static_cast<uint8_t>(100 + y);
      image.row(y)[3 * x + 2] = 60;
    }
  }
  return image;
}

TEST(Jpeg, decodes_an_encoded_picture_within_12_grey_values) {
  const Image image = gradient({64, 48});
  const auto back = decode_jpeg(encode_jpeg(image.view(), 90), image.size);
  ASSERT_TRUE(back);
  for (size_t i = 0; i < image.bytes.size(); ++i) {
    ASSERT_LE(std::abs(image.bytes[i] - back->bytes[i]), 12) << i;
  }
}

TEST(Jpeg, rejects_a_picture_of_an_unexpected_size) {
  const auto bytes = encode_jpeg(gradient({64, 48}).view(), 90);
  EXPECT_FALSE(decode_jpeg(bytes, {64, 47}));
}

TEST(Jpeg, rejects_truncated_and_invalid_bytes) {
  const auto bytes = encode_jpeg(gradient({64, 48}).view(), 90);
  for (size_t length = 0; length + 2 < bytes.size(); length += 13) {
    EXPECT_FALSE(decode_jpeg(std::span(bytes).first(length), {64, 48})) << length;
  }
  EXPECT_FALSE(decode_jpeg(std::vector<uint8_t>(500, 0xd8), {64, 48}));
}

}  // namespace
}  // namespace v3d
