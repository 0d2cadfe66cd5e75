#include "v3dctl/operate/contact_sheet.h"

#include <gtest/gtest.h>

#include <algorithm>

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

TEST(ContactSheet, holds_every_picture_whole) {
  std::vector<SheetPicture> pictures;
  for (int i = 0; i < 5; ++i) {
    pictures.push_back({"", plain({60, 40}, static_cast<uint8_t>(100 + i)), {}});
  }
  const Image sheet = contact_sheet(pictures);
  for (int i = 0; i < 5; ++i) {
    const auto grey = static_cast<uint8_t>(100 + i);
    EXPECT_EQ(count_of(sheet, grey, grey, grey), 60 * 40);
  }
}

TEST(ContactSheet, writes_names_and_says_which_picture_did_not_come) {
  const int64_t named =
      count_of(contact_sheet({{"cam01", plain({200, 40}, 9), {}}}), 255, 255, 255);
  const int64_t none = count_of(contact_sheet({{"cam01", {}, {}}}), 255, 255, 255);
  EXPECT_GT(named, 100);
  EXPECT_GT(none, named) << "the name, and that there is no picture";
}

TEST(ContactSheet, draws_the_rim_of_the_silhouette_and_nothing_of_its_inside) {
  Mask mask({60, 40});
  for (int y = 10; y < 20; ++y) mask.fill_row(y, 5, 15);
  const Image sheet = contact_sheet({{"", plain({60, 40}, 9), mask}});
  EXPECT_EQ(count_of(sheet, 255, 0, 200), 36) << "the rim of 10 x 10 pixels";
}

TEST(ContactSheet, passes_over_a_mask_of_another_size) {
  Mask mask({30, 20});
  mask.set(5, 5);
  EXPECT_EQ(count_of(contact_sheet({{"", plain({60, 40}, 9), mask}}), 255, 0, 200), 0);
}

TEST(ContactSheet, writes_no_text_outside_of_its_image) {
  Image image = plain({20, 8}, 0);
  draw_text(image, -6, -3, "cam01 and much more");
  draw_text(image, 15, 5, "\xff");
  EXPECT_EQ(image.bytes.size(), 20U * 8 * 3);
}

}  // namespace
}  // namespace v3d::ctl
