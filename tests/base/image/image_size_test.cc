#include <gtest/gtest.h>

#include "base/core/error.h"
#include "base/image/image.h"
#include "support/message_of.h"

namespace v3d {
namespace {

TEST(Size, reads_width_and_height_in_pixels) {
  EXPECT_EQ(parse_size("1024x768"), (ImageSize{1024, 768}));
  EXPECT_EQ(parse_size("659x494"), (ImageSize{659, 494}));
  EXPECT_EQ(parse_size("16x16384"), (ImageSize{16, kMaxImageSide}));
  for (const char* wrong : {"", "x", "1024", "1024x", "x768", "15x768", "1024*768", "-16x16",
                            "1024x16385", "99999999999x16", "1024x768x3", "64x48 ", "1024X768"}) {
    EXPECT_THROW(parse_size(wrong), InputError) << wrong;
  }
  EXPECT_EQ(format_size({659, 494}), "659x494");
}

TEST(Size, rejects_odd_sides_for_a_bayer_mosaic) {
  EXPECT_EQ(parse_size("1024x768", Sides::kEven), (ImageSize{1024, 768}));
  EXPECT_THROW(parse_size("1023x768", Sides::kEven), InputError);
  EXPECT_EQ(test::message_of<InputError>([] { parse_size("1024x767", Sides::kEven, "--of"); }),
            "--of 1024x767: expected WIDTHxHEIGHT, even numbers of pixels from 16 to 16384, like "
            "1024x768");
}

}  // namespace
}  // namespace v3d
