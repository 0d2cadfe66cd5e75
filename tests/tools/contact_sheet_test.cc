#include <gtest/gtest.h>

#include <algorithm>

#include "v3dctl/operate/camera_report.h"

namespace v3d::ctl {
namespace {

Image plain(ImageSize size, uint8_t grey) {
  Image image(size, PixelFormat::kRGB8);
  std::fill(image.bytes.begin(), image.bytes.end(), grey);
  return image;
}

int64_t count_of(const Image& image, uint8_t red, uint8_t green, uint8_t blue) {
  int64_t count = 0;
  for (size_t i = 0; i < image.bytes.size(); i += 3) {
    count += image.bytes[i] == red && image.bytes[i + 1] == green && image.bytes[i + 2] == blue;
  }
  return count;
}

TEST(ContactSheet, shows_every_image_whole) {
  std::vector<SheetImage> images;
  for (int i = 0; i < 5; ++i) {
    images.push_back({"", plain({60, 40}, static_cast<uint8_t>(100 + i)), {}});
  }
  const Image sheet = contact_sheet(images);
  for (int i = 0; i < 5; ++i) {
    const auto grey = static_cast<uint8_t>(100 + i);
    EXPECT_EQ(count_of(sheet, grey, grey, grey), 60 * 40);
  }
}

TEST(ContactSheet, shows_names_and_marks_a_missing_image) {
  const int64_t named =
      count_of(contact_sheet({{"cam01", plain({200, 40}, 9), {}}}), 255, 255, 255);
  const int64_t none = count_of(contact_sheet({{"cam01", {}, {}}}), 255, 255, 255);
  EXPECT_GT(named, 100);
  EXPECT_GT(none, named) << "the name and a mark";
}

TEST(ContactSheet, draws_the_outline_of_the_silhouette_only) {
  Mask mask({60, 40});
  for (int y = 10; y < 20; ++y) mask.fill_row(y, 5, 15);
  const Image sheet = contact_sheet({{"", plain({60, 40}, 9), mask}});
  EXPECT_EQ(count_of(sheet, 255, 0, 200), 36) << "the outline of 10 x 10 pixels";
}

TEST(ContactSheet, ignores_a_mask_of_another_size) {
  Mask mask({30, 20});
  mask.set(5, 5);
  EXPECT_EQ(count_of(contact_sheet({{"", plain({60, 40}, 9), mask}}), 255, 0, 200), 0);
}

TEST(ContactSheet, clips_text_to_the_image) {
  Image image = plain({20, 8}, 0);
  draw_text(image, -6, -3, "cam01 and much more");
  draw_text(image, 15, 5, "\xff");
  EXPECT_EQ(image.bytes.size(), 20U * 8 * 3);
}

}  // namespace
}  // namespace v3d::ctl
