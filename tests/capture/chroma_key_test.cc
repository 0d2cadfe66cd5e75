// Segmentation with a chroma key: folded green cloth, changing lamps, a grey floor, and light that
// the cloth reflects on the performer.
#include <gtest/gtest.h>

#include "base/image/mask_operations.h"
#include "capture/segmentation/segmenter.h"
#include "studio_wall.h"

namespace v3d::capture {
namespace {

constexpr ImageSize kSize{240, 160};
constexpr int kFloor = 140;  ///< grey from this row on

/// Colour of the cloth, whose folds move by `shift` pixels. `light`: brightness of the lamps.
Colour cloth(int x, double light, double shift) {
  const double fold = 0.8 + 0.12 * std::sin(0.15 * (x + shift));
  return {46 * light * fold, 150 * light * fold, 58 * light * fold};
}
Scene empty_studio(double light, double shift) {
  return [=](int x, int y) { return y < kFloor ? cloth(x, light, shift) : Colour{90, 92, 88}; };
}
/// The empty studio lit unevenly: one lamp is off, another brighter.
Colour other_light(int x, int y) {
  return y < kFloor ? cloth(x, 0.6 + 0.002 * x, 12) : Colour{72, 73.6, 70.4};
}

/// Five stripes of a person: skin, white, black, a warm grey, and a green unlike the studio's.
/// `spill`: part of the cloth's light that is reflected on the person.
constexpr Colour kStripes[] = {
    {190, 140, 118}, {215, 212, 208}, {24, 22, 24}, {120, 105, 95}, {120, 150, 60}};
bool is_person(int x, int y) { return x >= 40 && x < 190 && y >= 20 && y < 130; }
Scene person(double spill) {
  return [=](int x, int y) {
    if (!is_person(x, y)) return other_light(x, y);
    const Colour& own = kStripes[(x - 40) / 30];
    return Colour{own[0] + 46 * spill, own[1] + 150 * spill, own[2] + 58 * spill};
  };
}

Mask floor() {
  Mask mask(kSize);
  for (int y = kFloor; y < kSize.height; ++y) mask.fill_row(y, 0, kSize.width);
  return mask;
}

class GreenStudio : public testing::TestWithParam<PixelFormat> {
 protected:
  Mask segment(const Scene& scene, ChromaKey key) const {
    segmentation::BackgroundModel model = model_;
    model.key = key;
    return segmentation::Segmenter(model, {}).segment(
        photograph(kSize, GetParam(), scene, 5).view());
  }
  const segmentation::BackgroundModel model_ = learn_scene(kSize, GetParam(), empty_studio(1, 0));
};

INSTANTIATE_TEST_SUITE_P(Formats, GreenStudio,
                         testing::Values(PixelFormat::kBayerRG8, PixelFormat::kBayerGB8,
                                         PixelFormat::kRGB8),
                         [](const auto& format) { return std::string(name(format.param)); });

TEST_P(GreenStudio, is_background_in_any_light_and_folds_with_a_chroma_key) {
  EXPECT_GT(segment(other_light, ChromaKey::kNone).count(), 2000);
  EXPECT_EQ(segment(other_light, ChromaKey::kGreen).count(), 0);
}

TEST_P(GreenStudio, keeps_a_person_whole_in_light_reflected_by_the_cloth) {
  Mask truth(kSize);
  for (int y = 20; y < 130; ++y) truth.fill_row(y, 40, 190);
  for (const double spill : {0.0, 0.1, 0.2}) {
    const Mask mask = difference_of(segment(person(spill), ChromaKey::kGreen), floor());
    EXPECT_GT(intersection_over_union(mask, truth), 0.985) << spill;
  }
}

TEST_P(GreenStudio, applies_the_key_only_to_its_colour) {
  const auto on_the_floor = [](int x, int y) {
    return y >= kFloor && x > 100 && x < 140 ? Colour{60, 130, 70} : other_light(x, y);
  };
  const Mask mask = segment(on_the_floor, ChromaKey::kGreen);
  EXPECT_NEAR(static_cast<double>(mask.count()), 39 * 20, 80)
      << "green in front of grey is foreground";
  EXPECT_GT(segment(other_light, ChromaKey::kBlue).count(), 2000);
}

}  // namespace
}  // namespace v3d::capture
