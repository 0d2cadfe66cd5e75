#include "base/image/jpeg.h"

#include <gtest/gtest.h>

#include <cstdlib>

namespace v3d {
namespace {

/// A soft gradient, which JPEG keeps nearly as it is.
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

TEST(Jpeg, gives_back_a_picture_that_looks_the_same) {
  const Image image = gradient({64, 48});
  const auto back = decode_jpeg(encode_jpeg(image.view(), 90), image.size);
  ASSERT_TRUE(back);
  for (size_t i = 0; i < image.bytes.size(); ++i) {
    ASSERT_LE(std::abs(image.bytes[i] - back->bytes[i]), 12) << i;
  }
}

TEST(Jpeg, gives_nothing_for_another_size_than_was_promised) {
  const auto bytes = encode_jpeg(gradient({64, 48}).view(), 90);
  EXPECT_FALSE(decode_jpeg(bytes, {64, 47}));
}

TEST(Jpeg, gives_nothing_for_a_picture_that_is_cut_or_none) {
  const auto bytes = encode_jpeg(gradient({64, 48}).view(), 90);
  for (size_t length = 0; length + 2 < bytes.size(); length += 13) {
    EXPECT_FALSE(decode_jpeg(std::span(bytes).first(length), {64, 48})) << length;
  }
  EXPECT_FALSE(decode_jpeg(std::vector<uint8_t>(500, 0xd8), {64, 48}));
}

}  // namespace
}  // namespace v3d
