#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

#include "base/core/error.h"
#include "base/image/image_files.h"
#include "base/io/file.h"
#include "support/message_of.h"
#include "support/temporary_folder.h"

namespace v3d {
namespace {

using testing::AllOf;
using testing::HasSubstr;

DeepImage ramp(ImageSize size, int channels) {
  DeepImage image{size, channels, {}};
  for (int64_t i = 0; i < size.pixels() * channels; ++i) {
    image.samples.push_back(static_cast<uint16_t>(i * 257));
  }
  return image;
}

std::string error_of(std::string_view bytes) {
  return test::message_of<InputError>([&] { decode_png(bytes, "plate.png"); });
}

TEST(PngFile, keeps_every_bit_of_grey_and_rgb) {
  for (const int channels : {1, 3}) {
    const DeepImage image = ramp({37, 11}, channels);
    const DeepImage back = decode_png(encode_png(image), "plate.png");
    EXPECT_EQ(back.size, image.size);
    EXPECT_EQ(back.channels, channels);
    EXPECT_EQ(back.samples, image.samples);
  }
}

TEST(PngFile, rejects_truncated_and_invalid_bytes_and_names_the_file) {
  const std::string whole = encode_png(ramp({37, 11}, 1));
  constexpr size_t kTrailerBytes = 24;  // check sums and the end chunk
  for (size_t keep = 0; keep + kTrailerBytes < whole.size(); keep += 7) {
    EXPECT_THAT(error_of({whole.data(), keep}), HasSubstr("plate.png: not a valid PNG image"));
  }
  EXPECT_THAT(error_of("not a picture"), HasSubstr("plate.png: not a valid PNG image"));
}

TEST(PngFile, rejects_8_bits_and_reports_the_expected_format) {
  const test::TemporaryFolder folder;
  write_png(folder / "grey.png", Image({4, 3}, PixelFormat::kMono8).view());
  EXPECT_THAT(error_of(read_file(folder / "grey.png")),
              AllOf(HasSubstr("plate.png"), HasSubstr("16 bits, grey or RGB")));
}

TEST(PngFile, of_a_grey_image_is_grey) {
  constexpr size_t kColourType = 25;  // in the header; 0: grey, 2: RGB
  const test::TemporaryFolder folder;
  write_png(folder / "grey.png", Image({4, 3}, PixelFormat::kMono8).view());
  write_png(folder / "rgb.png", Image({4, 3}, PixelFormat::kRGB8).view());
  EXPECT_EQ(read_file(folder / "grey.png").at(kColourType), 0);
  EXPECT_EQ(read_file(folder / "rgb.png").at(kColourType), 2);
}

TEST(PngFile, written_fast_has_the_same_pixels) {
  Image image({64, 48}, PixelFormat::kRGB8);
  for (size_t i = 0; i < image.bytes.size(); ++i) image.bytes[i] = static_cast<uint8_t>(i * i / 7);
  const test::TemporaryFolder folder;
  write_png(folder / "fast.png", image.view(), PngEffort::kFast);
  EXPECT_EQ(read_picture(folder / "fast.png").bytes, image.bytes);
}

TEST(PngFile, rejects_a_size_that_its_bytes_cannot_hold) {
  std::string bytes = encode_png(ramp({37, 11}, 1)).substr(0, 33);  // the header
  bytes[18] = bytes[22] = 0x30;                                     // 12,325 x 12,299
  EXPECT_THAT(error_of(bytes), HasSubstr("plate.png: not a valid PNG image"));
  const DeepImage black{{3000, 1000}, 1, std::vector<uint16_t>(3'000'000)};
  EXPECT_EQ(decode_png(encode_png(black), "plate.png").samples, black.samples);
}

RC_GTEST_PROP(PngFile, with_a_flipped_bit_is_decoded_or_rejected, ()) {
  std::string bytes = encode_png(ramp({9, 5}, 3));
  const auto at = *rc::gen::inRange<size_t>(0, bytes.size());
  bytes[at] = static_cast<char>(bytes[at] ^ (1 << *rc::gen::inRange(0, 8)));
  try {
    const DeepImage image = decode_png(bytes, "plate.png");
    RC_ASSERT(static_cast<int64_t>(image.samples.size()) == image.size.pixels() * image.channels);
  } catch (const InputError&) {
  }
}

}  // namespace
}  // namespace v3d
