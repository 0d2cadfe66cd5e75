#include "recon/silhouettes/frame_lag.h"

#include <gtest/gtest.h>

namespace v3d::recon {
namespace {

/// A bar that moved by `step` pixels to the right, in an image of `size`. The camera shows it
/// `late` pulses late.
SilhouetteChange bar_moved(ImageSize size, int step, int late) {
  const auto bar = [&](int x) {
    Mask mask(size);
    for (int y = 100; y < 300; ++y) mask.fill_row(y, x, x + 80);
    return mask;
  };
  return silhouette_change(bar(200 - late * step), bar(200), bar(200 - step));
}

TEST(SilhouetteChangeTest, of_a_synchronous_camera_contains_gained_and_no_lost_pixels) {
  const SilhouetteChange change = bar_moved({1024, 768}, 5, 0);
  EXPECT_EQ(change.lost, 1000);
  EXPECT_EQ(change.lost_shown, 0);
  EXPECT_EQ(change.gained, 1000);
  EXPECT_EQ(change.gained_shown, 1000);
  EXPECT_FALSE(change.is_late());
  EXPECT_LT(change.excess(), 0);
}

TEST(SilhouetteChangeTest, of_a_camera_one_pulse_late_contains_lost_and_no_gained_pixels) {
  const SilhouetteChange change = bar_moved({1024, 768}, 5, 1);
  EXPECT_EQ(change.lost_shown, 1000);
  EXPECT_EQ(change.gained_shown, 0);
  EXPECT_TRUE(change.is_late());
  EXPECT_GT(change.excess(), 0);
}

TEST(SilhouetteChangeTest, is_inconclusive_with_few_rim_pixels_of_a_still_body) {
  const auto is_late = [](int64_t shown) {
    return SilhouetteChange{.pixels = 1024 * 768, .lost = 80, .lost_shown = shown, .gained = 80}
        .is_late();
  };
  EXPECT_FALSE(is_late(59));
  EXPECT_TRUE(is_late(60));
}

// Values of one of 8 synchronous cameras.
TEST(SilhouetteChangeTest, is_inconclusive_when_both_parts_are_similar) {
  EXPECT_FALSE(
      (SilhouetteChange{
           .pixels = 1024 * 768, .lost = 332, .lost_shown = 70, .gained = 323, .gained_shown = 24})
          .is_late());
}

TEST(SilhouetteChangeTest,
     must_be_so_much_more_as_the_image_has_more_pixels_but_never_less_than_at_xga) {
  const auto is_late = [](ImageSize size, int64_t shown) {
    return SilhouetteChange{.pixels = int64_t{size.width} * size.height,
                            .lost = 1000,
                            .lost_shown = shown,
                            .gained = 1000}
        .is_late();
  };
  EXPECT_TRUE(is_late({4096, 3072}, 960));
  EXPECT_FALSE(is_late({4096, 3072}, 959));
  EXPECT_TRUE(is_late({320, 240}, 130));
  EXPECT_FALSE(is_late({320, 240}, 59));
}

}  // namespace
}  // namespace v3d::recon
