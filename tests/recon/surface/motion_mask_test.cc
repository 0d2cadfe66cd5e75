#include <gtest/gtest.h>

#include <random>

#include "recon/shapes.h"
#include "recon/surface/temporal_smoothing.h"

namespace v3d::recon {
namespace {

constexpr ImageSize kSize{120, 90};
/// The silhouette, and a pixel well inside of it.
constexpr Rect kSeen{20, 20, 80, 50};
const Eigen::Vector2f kMiddle(60.5F, 45.5F);

/// The frame of a static camera at one pulse.
struct Picture {
  CameraModel model = shapes::camera({2, 0, 1}, {0, 0, 1}, kSize, 100);
  Image raw{kSize, PixelFormat::kMono8};
  Mask mask{kSize};
  Frame frame;
  std::optional<SurfaceCamera> camera;

  Picture() {
    std::mt19937 random(6);
    for (uint8_t& byte : raw.bytes) byte = static_cast<uint8_t>(50 + random() % 100);
    for (int y = kSeen.y0; y < kSeen.y0 + kSeen.height; ++y) {
      mask.fill_row(y, kSeen.x0, kSeen.x0 + kSeen.width);
    }
  }
  const SurfaceCamera& seen() {
    frame = observe("cam", {}, raw.view(), mask);
    return camera.emplace(DeformCamera{&model, &frame});
  }
  void brighten(const Rect& where, int by) {
    for (int y = where.y0; y < where.y0 + where.height; ++y) {
      for (int x = where.x0; x < where.x0 + where.width; ++x) {
        raw.row(y)[x] = static_cast<uint8_t>(raw.row(y)[x] + by);
      }
    }
  }
};

float stillness_after(int brighter, const Rect& where = {0, 0, kSize.width, kSize.height}) {
  Picture now, then;
  now.brighten(where, brighter);
  return static_weight(now.seen(), then.seen(), kMiddle);
}

TEST(MotionMask, is_1_where_two_pictures_are_the_same_but_for_noise) {
  EXPECT_EQ(stillness_after(0), 1);
  EXPECT_EQ(stillness_after(1), 1);
}

TEST(MotionMask, is_0_where_something_moved_and_falls_evenly_between) {
  EXPECT_NEAR(stillness_after(2), (3.0 - 2.0) / 1.5, 1e-6);
  EXPECT_EQ(stillness_after(3), 0);
  EXPECT_EQ(stillness_after(60), 0);
}

TEST(MotionMask, counts_darker_and_brighter_pixels_alike) {
  Picture now, then;
  now.brighten({0, 0, kSize.width, kSize.height}, 20);
  for (int y = 0; y < kSize.height; y += 4) now.brighten({0, y, kSize.width, 2}, -40);
  EXPECT_EQ(static_weight(now.seen(), then.seen(), kMiddle), 0) << "the mean has not changed";
}

TEST(MotionMask, uses_only_the_neighbourhood_of_the_pixel) {
  EXPECT_EQ(stillness_after(60, {kSeen.x0, kSeen.y0, 20, 20}), 1);
  EXPECT_EQ(stillness_after(60, {56, 41, 10, 10}), 0);
}

TEST(MotionMask, is_0_more_than_three_pixels_outside_the_other_silhouette) {
  Picture now, then;
  now.mask.fill_row(45, 0, kSize.width);
  const SurfaceCamera& current = now.seen();
  const SurfaceCamera& former = then.seen();
  const auto at = [&](float x) { return static_weight(current, former, {x, 45.5F}); };
  EXPECT_EQ(at(kSeen.x0 + 6.5F), 1);
  EXPECT_EQ(at(kSeen.x0 - 6.5F), 0);
  then.mask = Mask(kSize);
  then.mask.fill_row(44, 56, 58);
  EXPECT_EQ(static_weight(current, then.seen(), {57.5F, 55.5F}), 0);
}

TEST(MotionMask, does_not_depend_on_where_the_box_of_the_silhouette_begins) {
  for (const int halvings : {0, 1, 2}) {
    Picture now, then;
    for (int y = 0; y < kSize.height; ++y) {
      for (int x = 0; x < kSeen.x0 + 2; ++x) then.mask.set(x, y, false);
    }
    now.frame = observe("cam", {}, now.raw.view(), now.mask);
    then.frame = observe("cam", {}, then.raw.view(), then.mask);
    ASSERT_EQ(then.frame.roi.x0, now.frame.roi.x0 + 2);
    const SurfaceCamera a({&now.model, &now.frame}, halvings);
    const SurfaceCamera b({&then.model, &then.frame}, halvings);
    EXPECT_EQ(static_weight(a, b, kMiddle), 1) << halvings << " halvings";
  }
}

TEST(MotionMask, compares_pictures_of_the_same_resolution) {
  Picture now, then;
  now.frame = observe("cam", {}, now.raw.view(), now.mask);
  then.frame = observe("cam", {}, then.raw.view(), then.mask);
  const SurfaceCamera fine({&now.model, &now.frame}, 0), coarse({&then.model, &then.frame}, 1);
  EXPECT_EQ(static_weight(fine, coarse, kMiddle), 1);
  EXPECT_EQ(static_weight(coarse, fine, kMiddle), 1);
}

TEST(MotionMask, is_0_beyond_the_border_of_a_picture) {
  Picture now, then;
  const SurfaceCamera& current = now.seen();
  EXPECT_EQ(static_weight(current, then.seen(), {-5, 45}), 0);
  EXPECT_EQ(static_weight(current, then.seen(), {60, 500}), 0);
}

}  // namespace
}  // namespace v3d::recon
