#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/core/error.h"
#include "base/image/image_files.h"
#include "base/io/file.h"
#include "support/message_of.h"
#include "support/temporary_folder.h"

namespace v3d {
namespace {

Image ramp(ImageSize size) {
  Image image(size, PixelFormat::kRGB8);
  for (size_t i = 0; i < image.bytes.size(); ++i) image.bytes[i] = static_cast<uint8_t>(i * 5);
  return image;
}

TEST(Picture, reads_a_png_as_it_was_written) {
  const test::TemporaryFolder folder;
  const Image image = ramp({9, 4});
  write_png(folder / "sky.png", image.view());
  const Image back = read_picture(folder / "sky.png");
  EXPECT_EQ(back.size, image.size);
  EXPECT_EQ(back.bytes, image.bytes);
}

TEST(Picture, converts_16_bit_and_grey_png_to_8_bit_rgb) {
  const std::string png = encode_png({{2, 1}, 1, {0x4000, 0xffff}});
  EXPECT_EQ(decode_picture(png, "sky.png").bytes,
            (std::vector<uint8_t>{0x40, 0x40, 0x40, 0xff, 0xff, 0xff}));
}

TEST(Picture, reduced_has_the_means_of_whole_blocks) {
  Image picture({5, 3}, PixelFormat::kRGB8);
  for (int y = 0; y < 3; ++y) {
    for (int x = 0; x < 5; ++x) {
      const int value = 10 * y + x;
      for (int c = 0; c < 3; ++c) picture.row(y)[3 * x + c] = static_cast<uint8_t>(c + value);
    }
  }
  const Image small = reduced(picture, 2);
  EXPECT_EQ(small.size, (ImageSize{2, 1}));
  // 0, 1, 10 and 11 have the mean 5.5, and 2, 3, 12 and 13 the mean 7.5; halves round up.
  EXPECT_EQ(small.bytes, (std::vector<uint8_t>{6, 7, 8, 8, 9, 10}));
}

TEST(Picture, becomes_a_mask_where_it_is_brighter_than_half) {
  Image picture({4, 1}, PixelFormat::kRGB8);
  picture.bytes = {0, 0, 0, 127, 128, 128, 128, 128, 128, 255, 129, 0};
  const Mask mask = mask_from_picture(picture);
  EXPECT_EQ(mask.size(), (ImageSize{4, 1}));
  EXPECT_EQ(mask.row(0)[0], 0b1100U);
}

TEST(Picture, reads_size_and_colours_of_a_jpeg) {
  Image even({16, 24}, PixelFormat::kRGB8);
  for (size_t i = 0; i < even.bytes.size(); ++i) even.bytes[i] = i % 3 == 0 ? 200 : 40;
  const std::vector<uint8_t> jpeg = encode_jpeg(even.view(), 95);
  const Image back =
      decode_picture({reinterpret_cast<const char*>(jpeg.data()), jpeg.size()}, "sky.jpg");
  EXPECT_EQ(back.size, even.size);
  EXPECT_NEAR(back.bytes[0], 200, 3);
  EXPECT_NEAR(back.bytes[1], 40, 3);
}

TEST(Picture, rejects_invalid_bytes_and_names_the_file) {
  const std::string png = encode_png({{4, 4}, 3, std::vector<uint16_t>(48, 7)});
  for (const std::string& bytes :
       {std::string(), std::string("GIF89a"), png.substr(0, 60), png.substr(0, 8)}) {
    EXPECT_THAT(test::message_of<InputError>([&] { decode_picture(bytes, "sky.png"); }),
                testing::HasSubstr("sky.png: not a valid PNG"));
  }
}

TEST(Picture, fill_size_crops_to_the_centre) {
  Image stripes({4, 2}, PixelFormat::kRGB8);
  for (int y = 0; y < 2; ++y) {
    for (int x = 0; x < 4; ++x) stripes.row(y)[3 * x] = static_cast<uint8_t>(60 * x);
  }
  const Image same = fill_size(stripes, {4, 2});
  EXPECT_EQ(same.bytes, stripes.bytes);
  const Image middle = fill_size(stripes, {2, 2});
  EXPECT_EQ(middle.row(0)[0], 60) << "both sides are cropped equally";
  EXPECT_EQ(middle.row(1)[3], 120);
}

TEST(Picture, sampling_repeats_horizontally_and_clamps_vertically) {
  const Image image = ramp({4, 2});
  uint8_t rgb[3];
  sample_picture(image, -1, -5, rgb);
  EXPECT_EQ(rgb[0], image.row(0)[9]);
  sample_picture(image, 4, 7, rgb);
  EXPECT_EQ(rgb[1], image.row(1)[1]);
}

}  // namespace
}  // namespace v3d
