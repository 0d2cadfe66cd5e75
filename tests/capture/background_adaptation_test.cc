#include <gtest/gtest.h>

#include <algorithm>
#include <utility>

#include "capture/segmentation/background.h"
#include "capture/segmentation/image_measures.h"
#include "capture/segmentation/segmenter.h"
#include "studio_wall.h"
#include "support/instruction_sets.h"

namespace v3d::capture {
namespace {

constexpr ImageSize kSize{130, 97};
constexpr Rect kBody{60, 20, 40, 55};
constexpr int kSunnyWidth = 35;
constexpr int64_t kTenMinutes = 10 * 60 * 25;  // pulses
constexpr int64_t kLearnEvery = 32;

Mask mask_of_body() {
  Mask mask(kSize);
  for (int y = kBody.y0; y < kBody.y0 + kBody.height; ++y) {
    mask.fill_row(y, kBody.x0, kBody.x0 + kBody.width);
  }
  return mask;
}

/// The wall, brighter on its left side by the part `sun`.
Scene lit(double sun) {
  return [=](int x, int y) {
    const Colour c = wall(x, y);
    const double light = x < kSunnyWidth ? 1 + sun : 1;
    return Colour{light * c[0], light * c[1], light * c[2]};
  };
}
Scene in_front_of(const Scene& behind, const Scene& cloth) {
  return [=](int x, int y) { return kBody.contains(x, y) ? cloth(x, y) : behind(x, y); };
}
Colour yellow_cloth(int, int) { return {180, 150, 60}; }
/// Nearly the wall's colour.
Colour faint_cloth(int x, int y) {
  const Colour c = wall(x, y);
  return {c[0] + 24, c[1] + 9, c[2]};
}

class BackgroundAdaptationTest : public testing::TestWithParam<PixelFormat> {
 protected:
  Image photograph(const Scene& scene, int64_t seed) const {
    return capture::photograph(kSize, GetParam(), scene, static_cast<unsigned>(seed));
  }
  Mask segment(const Scene& scene) { return segmenter_.segment(photograph(scene, 7).view()); }
  void learn(int64_t pulse, const Image& image) {
    ASSERT_TRUE(segmenter_.learns_from(pulse));
    segmenter_.learn(pulse, image.view(), segmenter_.segment(image.view()));
  }
  /// Learns ten minutes of a scene that changes with the elapsed part of that time.
  void record(const std::function<Scene(double)>& scene) {
    for (int64_t pulse = 0; pulse < kTenMinutes; pulse += kLearnEvery) {
      learn(pulse, photograph(scene(double(pulse) / kTenMinutes), pulse));
    }
  }
  /// Learns ten minutes of a constant scene with changing noise.
  void record_still(const Scene& scene) {
    std::vector<Image> images;
    for (int64_t seed = 0; seed < 8; ++seed) images.push_back(photograph(scene, seed));
    for (int64_t pulse = 0; pulse < kTenMinutes; pulse += kLearnEvery) {
      learn(pulse, images[static_cast<size_t>(pulse / kLearnEvery) % images.size()]);
    }
  }
  const segmentation::BackgroundModel model_ = learn_wall(kSize, GetParam());
  segmentation::Segmenter segmenter_{model_, {}};
};

INSTANTIATE_TEST_SUITE_P(Formats, BackgroundAdaptationTest,
                         testing::Values(PixelFormat::kMono8, PixelFormat::kBayerRG8,
                                         PixelFormat::kRGB8),
                         [](const auto& format) { return std::string(name(format.param)); });

TEST_P(BackgroundAdaptationTest, follows_sunlight_that_brightens_part_of_the_wall_by_20_percent) {
  EXPECT_GT(segment(lit(0.2)).count(), 1000);  // without adaptation
  record([&](double passed) {
    EXPECT_EQ(segment(lit(0.2 * passed)).count(), 0) << passed;
    return lit(0.2 * passed);
  });
  EXPECT_EQ(segment(lit(0.2)).count(), 0);
  const Mask mask = segment(in_front_of(lit(0.2), [](int, int) { return Colour{220, 200, 220}; }));
  EXPECT_GT(intersection_over_union(mask, mask_of_body()), 0.99);
}

TEST_P(BackgroundAdaptationTest, does_not_learn_a_performer_who_stands_still_for_ten_minutes) {
  for (const Scene& cloth : {Scene(yellow_cloth), Scene(faint_cloth)}) {
    segmenter_.restore_plates();
    const Scene standing = in_front_of(wall, cloth);
    const Mask at_first = segment(standing);
    EXPECT_GT(intersection_over_union(at_first, mask_of_body()), 0.9);
    record_still(standing);
    EXPECT_GT(intersection_over_union(segment(standing), at_first), 0.98);
    EXPECT_EQ(segment(wall).count(), 0);  // the wall behind was not learnt either
  }
}

TEST_P(BackgroundAdaptationTest, does_not_learn_the_shadow_of_a_still_performer) {
  const auto shaded = [](int x, int y) {
    const Colour c = wall(x, y);
    const double light = x >= 100 && y > 60 ? 0.75 : 1;
    return Colour{light * c[0], light * c[1], light * c[2]};
  };
  record_still(in_front_of(shaded, yellow_cloth));
  EXPECT_EQ(segment(wall).count(), 0);
}

TEST_P(BackgroundAdaptationTest, limits_the_change_to_a_quarter_of_the_plates) {
  record([](double passed) { return lit(0.8 * passed); });
  EXPECT_GT(segment(lit(0.8)).count(), 1000);
}

TEST_P(BackgroundAdaptationTest, learns_nothing_within_sixteen_pixels_of_the_mask) {
  const segmentation::BackgroundTable plates(model_, {});
  const Scene brighter = [](int x, int y) {
    const Colour c = wall(x, y);
    return Colour{c[0] + 4, c[1] + 4, c[2] + 4};
  };
  for (const auto& [u, v] : {std::pair{64, 48}, {95, 63}, {80, 50}}) {
    Mask mask(kSize);
    mask.set(u, v);
    segmentation::BackgroundTable table = plates;
    segmentation::BackgroundAdaptation(plates).adapt(photograph(brighter, 3).view(), mask,
                                                     segmentation::kUnitGain, table);
    EXPECT_GT(table.mean[0], plates.mean[0]);
    for (int y = v - 16; y <= v + 16; ++y) {
      const ptrdiff_t from = (ptrdiff_t{y} * kSize.width + u - 16) * plates.channels;
      const ptrdiff_t to = from + ptrdiff_t{33} * plates.channels;
      EXPECT_TRUE(std::equal(table.mean.begin() + from, table.mean.begin() + to,
                             plates.mean.begin() + from))
          << "row " << y << " near " << u << ", " << v;
    }
  }
}

TEST_P(BackgroundAdaptationTest, learns_no_sample_far_from_its_expected_value) {
  const Scene another = [](int x, int y) {
    const Colour c = wall(x, y);
    return Colour{c[0] + 40, c[1] + 40, c[2] + 40};
  };
  const segmentation::BackgroundTable plates(model_, {});
  segmentation::BackgroundTable table = plates;
  segmentation::BackgroundAdaptation(plates).adapt(photograph(another, 3).view(), Mask(kSize),
                                                   segmentation::kUnitGain, table);
  EXPECT_EQ(table.mean, plates.mean);
}

TEST_P(BackgroundAdaptationTest, learns_no_saturated_sample) {
  const auto with_lamp = [](double light) {
    return [=](int x, int y) {
      const Colour c = x < kSunnyWidth ? Colour{250, 250, 250} : wall(x, y);
      return Colour{light * c[0], light * c[1], light * c[2]};
    };
  };
  const segmentation::BackgroundTable plates(learn_scene(kSize, GetParam(), with_lamp(1)), {});
  segmentation::BackgroundTable table = plates;
  const Image image = photograph(with_lamp(1.08), 3);
  for (int i = 0; i < 50; ++i) {
    segmentation::BackgroundAdaptation(plates).adapt(
        image.view(), Mask(kSize), static_cast<uint32_t>(1.08 * segmentation::kUnitGain), table);
  }
  const ptrdiff_t lamp = ptrdiff_t{kSunnyWidth} * plates.channels;
  for (int y = 0; y < kSize.height; ++y) {
    const ptrdiff_t first = ptrdiff_t{y} * kSize.width * plates.channels;
    EXPECT_TRUE(std::equal(table.mean.begin() + first, table.mean.begin() + first + lamp,
                           plates.mean.begin() + first))
        << "row " << y;
  }
}

TEST_P(BackgroundAdaptationTest, restores_the_plates_after_forget) {
  const Mask before = segment(in_front_of(lit(0.2), yellow_cloth));
  record([](double passed) { return lit(0.2 * passed); });
  EXPECT_NE(segment(in_front_of(lit(0.2), yellow_cloth)), before);
  segmenter_.restore_plates();
  EXPECT_EQ(segment(in_front_of(lit(0.2), yellow_cloth)), before);
  EXPECT_TRUE(segmenter_.learns_from(0));
}

TEST_P(BackgroundAdaptationTest, is_the_same_on_every_instruction_set) {
  const Image image = photograph(in_front_of(lit(0.04), yellow_cloth), 3);
  const Mask mask = segmenter_.segment(image.view());
  const segmentation::BackgroundTable plates(model_, {});
  segmentation::BackgroundTable expected = plates;
  segmentation::BackgroundAdaptation(plates).adapt(image.view(), mask, segmentation::kUnitGain,
                                                   expected);
  EXPECT_NE(expected.mean, plates.mean);
  on_every_instruction_set([&] {
    segmentation::BackgroundTable table = plates;
    segmentation::BackgroundAdaptation(plates).adapt(image.view(), mask, segmentation::kUnitGain,
                                                     table);
    EXPECT_EQ(table.mean, expected.mean);
  });
}

TEST(Segmenter, learns_from_every_32nd_pulse_in_rising_order) {
  segmentation::Segmenter segmenter(learn_wall(kSize, PixelFormat::kMono8), {});
  const Image image = photograph(kSize, PixelFormat::kMono8, wall, 1);
  EXPECT_TRUE(segmenter.learns_from(0));
  EXPECT_FALSE(segmenter.learns_from(-32));
  EXPECT_FALSE(segmenter.learns_from(31));
  segmenter.learn(64, image.view(), segmenter.segment(image.view()));
  EXPECT_FALSE(segmenter.learns_from(64));
  EXPECT_FALSE(segmenter.learns_from(32));
  EXPECT_TRUE(segmenter.learns_from(96));
}

}  // namespace
}  // namespace v3d::capture
