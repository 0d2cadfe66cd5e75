#include "base/image/frame.h"

#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

namespace v3d {
namespace {

Image numbered_image(ImageSize size, PixelFormat format) {
  Image image(size, format);
  for (size_t i = 0; i < image.bytes.size(); ++i) {
    image.bytes[i] = static_cast<uint8_t>(i * 7 + i / 251);
  }
  return image;
}

RC_GTEST_PROP(Frame, observe_keeps_every_masked_pixel_and_its_bayer_phase, ()) {
  const ImageSize size{*rc::gen::inRange(1, 80), *rc::gen::inRange(1, 60)};
  const Image raw = numbered_image(size, PixelFormat::kBayerRG8);
  Mask mask(size);
  for (int i = *rc::gen::inRange(0, 4); i > 0; --i) {
    mask.set(*rc::gen::inRange(0, size.width), *rc::gen::inRange(0, size.height));
  }
  const Frame frame = observe("cam01", {}, raw.view(), mask);
  RC_ASSERT(frame.roi.x0 % 2 == 0);
  RC_ASSERT(frame.roi.y0 % 2 == 0);
  RC_ASSERT(frame.image.size == (ImageSize{frame.roi.width, frame.roi.height}));
  RC_ASSERT(frame.sensor_size == size);
  for (int y = 0; y < size.height; ++y) {
    for (int x = 0; x < size.width; ++x) {
      RC_ASSERT(!mask.get(x, y) || frame.roi.contains(x, y));
      if (frame.roi.contains(x, y)) {
        RC_ASSERT(frame.image.row(y - frame.roi.y0)[x - frame.roi.x0] == raw.row(y)[x]);
      }
    }
  }
}

TEST(Frame, observe_returns_no_pixels_for_an_empty_mask) {
  const Image raw = numbered_image({20, 10}, PixelFormat::kRGB8);
  const Frame frame = observe("cam01", {}, raw.view(), Mask({20, 10}));
  EXPECT_TRUE(frame.roi.empty());
  EXPECT_TRUE(frame.image.bytes.empty());
  EXPECT_EQ(frame.mask->count(), 0);
}

}  // namespace
}  // namespace v3d
