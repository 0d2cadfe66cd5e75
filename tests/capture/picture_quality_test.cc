#include <gtest/gtest.h>

#include "capture/segmentation/image_measures.h"
#include "studio_wall.h"

namespace v3d::capture {
namespace {

constexpr ImageSize kSize{160, 120};

/// Stripes blurred by a lens over `blur` pixels.
Colour stripes(int x, double blur) {
  const double grey = 120 + 80 * std::exp(-blur * blur / 8) * std::sin(1.1 * x);
  return {grey, grey, grey};
}

segmentation::PictureQuality quality_of(PixelFormat format, double blur, double noise,
                                        int pictures) {
  segmentation::PictureStatistics statistics;
  for (int i = 0; i < pictures; ++i) {
    const Image picture = photograph(
        kSize, format, [&](int x, int) { return stripes(x, blur); }, 7 + i, noise);
    statistics.add(picture.view());
  }
  return statistics.result();
}

TEST(PictureQuality, measures_shares_of_clipped_and_dark_samples) {
  Image picture({10, 10}, PixelFormat::kMono8);
  std::fill(picture.bytes.begin(), picture.bytes.end(), uint8_t{100});
  std::fill_n(picture.bytes.begin(), 20, uint8_t{255});
  std::fill_n(picture.bytes.begin() + 50, 10, uint8_t{3});
  segmentation::PictureStatistics statistics;
  statistics.add(picture.view());
  EXPECT_DOUBLE_EQ(statistics.result().clipped, 0.2);
  EXPECT_DOUBLE_EQ(statistics.result().dark, 0.1);
  EXPECT_DOUBLE_EQ(statistics.result().mean_grey, 121.3);
}

TEST(PictureQuality, focus_falls_as_the_lens_defocuses) {
  for (const auto format : {PixelFormat::kMono8, PixelFormat::kBayerRG8, PixelFormat::kRGB8}) {
    const double sharp = quality_of(format, 0, 1, 20).focus;
    const double soft = quality_of(format, 2, 1, 20).focus;
    const double blurred = quality_of(format, 4, 1, 20).focus;
    EXPECT_LT(soft, 0.5 * sharp) << name(format);
    EXPECT_LT(blurred, 0.5 * soft) << name(format);
  }
}

TEST(PictureQuality, focus_does_not_count_noise_as_detail) {
  const double quiet = quality_of(PixelFormat::kBayerRG8, 0, 1, 40).focus;
  const double noisy = quality_of(PixelFormat::kBayerRG8, 0, 6, 40).focus;
  EXPECT_NEAR(noisy / quiet, 1, 0.05);
}

TEST(PictureQuality, focus_of_a_background_model_equals_that_of_images) {
  std::vector<Image> plates;
  std::vector<ImageView> views;
  for (unsigned i = 0; i < 16; ++i) {
    plates.push_back(photograph(
        kSize, PixelFormat::kBayerRG8, [](int x, int) { return stripes(x, 1); }, 900 + i));
  }
  for (const Image& plate : plates) views.push_back(plate.view());
  const double plates_focus = focus_of(segmentation::learn_background(views));
  EXPECT_NEAR(quality_of(PixelFormat::kBayerRG8, 1, 1.5, 40).focus / plates_focus, 1, 0.05);
}

TEST(PictureQuality, is_zero_without_images_and_ignores_other_sizes) {
  segmentation::PictureStatistics statistics;
  EXPECT_EQ(statistics.result().focus, 0);
  statistics.add(Image({10, 10}, PixelFormat::kMono8).view());
  statistics.add(Image({12, 10}, PixelFormat::kMono8).view());
  EXPECT_EQ(statistics.pictures(), 1);
}

}  // namespace
}  // namespace v3d::capture
