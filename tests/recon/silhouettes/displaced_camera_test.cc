#include "recon/silhouettes/displaced_camera.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "base/geometry/rigid_transform.h"
#include "recon/render/renderer.h"
#include "recon/shapes.h"
#include "recon/silhouettes/leave_one_out_hull.h"

namespace v3d::recon {
namespace {

const Box kSpace{{-0.6, -0.6, -0.6}, {0.6, 0.6, 0.6}};

Mask moved(const Mask& mask, int right, int down) {
  Mask result(mask.size());
  for (int y = 0; y < mask.size().height; ++y) {
    for (int x = 0; x < mask.size().width; ++x) {
      const int from_x = x - right;
      const int from_y = y - down;
      const bool inside =
          from_x >= 0 && from_y >= 0 && from_x < mask.size().width && from_y < mask.size().height;
      if (inside && mask.get(from_x, from_y)) result.set(x, y);
    }
  }
  return result;
}

TEST(OutlineOffsets, of_a_silhouette_moved_aside_point_out_of_the_hull_on_that_side) {
  const CameraModel camera = shapes::camera({3, 0, 0}, {0, 0, 0}, {320, 240}, 500);
  const Mask hull = draw_silhouette(shapes::sphere({0, 0, 0}, 0.4F, 32), camera);
  const auto offsets = outline_offsets(hull, moved(hull, 5, -3), 1);
  EXPECT_GT(offsets.size(), 300U);
  for (const OutlineOffset& o : offsets) {
    EXPECT_NEAR(o.distance, 5 * o.nx - 3 * o.ny, 1.5);
    EXPECT_NEAR(o.nx * o.nx + o.ny * o.ny, 1, 1e-5);
  }
}

TEST(OutlineOffsets, of_images_eight_times_as_wide_are_the_same) {
  const auto offsets = [](int scale) {
    const ImageSize size{320 * scale, 240 * scale};
    const CameraModel camera = shapes::camera({3, 0, 0}, {0, 0, 0}, size, 500 * scale);
    const Mask hull = draw_silhouette(shapes::sphere({0, 0, 0}, 0.4F, 64), camera);
    const int wider = displacement_scale(size);
    return outline_offsets(hull, moved(hull, 5 * wider, -3 * wider), 1);
  };
  EXPECT_EQ(displacement_scale({1024, 768}), 1);
  EXPECT_EQ(displacement_scale({1280, 1024}), 1);
  EXPECT_EQ(displacement_scale({2048, 1536}), 2);
  EXPECT_EQ(displacement_scale({4096, 3072}), 4);
  const auto large =
      offsets(8);  // 2560 pixels: three count as one, and the ball is 2.7 times as wide
  EXPECT_GT(large.size(), 2 * offsets(1).size());
  EXPECT_LT(large.size(), 3 * offsets(1).size());
  for (const OutlineOffset& o : large) EXPECT_NEAR(o.distance, 5 * o.nx - 3 * o.ny, 1.5);
}

/// A ring of cameras around a moving ball; the silhouettes of `camera` are shifted. `scale`: image
/// size.
std::vector<CameraDisplacement> drift_of(int camera, int right, int down, int scale = 1) {
  constexpr int kCameras = 10;
  Rig rig;
  for (int i = 0; i < kCameras; ++i) {
    const double angle = 2 * std::numbers::pi * i / kCameras;
    rig.push_back({"cam" + std::to_string(i),
                   shapes::camera({3 * std::cos(angle), 3 * std::sin(angle), i % 2 ? 1.0 : -1.0},
                                  {0, 0, 0}, {320 * scale, 240 * scale}, 500. * scale)});
  }
  LeaveOneOutHull hulls(rig, kSpace, 0.01, 3);
  DisplacementMeter meter(rig);
  for (int pulse = 0; pulse < 4; ++pulse) {
    const auto height = static_cast<float>(0.1 * pulse - 0.2);
    const Mesh ball = shapes::sphere({0.1F, -0.1F, height}, 0.25F, 24);
    std::vector<Mask> masks = draw_silhouettes(ball, models_of(rig));
    if (camera >= 0) masks[camera] = moved(masks[camera], right, down);
    std::vector<const Mask*> all;
    for (const Mask& mask : masks) all.push_back(&mask);
    meter.add(all, hulls.silhouettes_of_each(all));
  }
  return meter.result(hulls);
}

TEST(DisplacedCamera, reports_no_undisplaced_camera) {
  for (const CameraDisplacement& camera : drift_of(-1, 0, 0)) {
    EXPECT_FALSE(camera.displaced) << camera.camera;
    EXPECT_LT(camera.shift.norm(), 0.5) << camera.camera;
  }
}

TEST(DisplacedCamera, reports_the_displaced_camera_and_its_shift) {
  const auto cameras = drift_of(3, 2, -3);
  for (size_t c = 0; c < cameras.size(); ++c) EXPECT_EQ(cameras[c].displaced, c == 3) << c;
  EXPECT_NEAR(cameras[3].shift.x(), 2, 0.5);
  EXPECT_NEAR(cameras[3].shift.y(), -3, 0.5);
}

TEST(DisplacedCamera, has_a_threshold_that_grows_with_the_image_size) {
  constexpr int kScale = 5;  // 1600 pixels a side: by displacement_scale() two count as one
  for (const CameraDisplacement& camera : drift_of(3, 2, 1, kScale))
    EXPECT_FALSE(camera.displaced) << camera.camera;
  const auto cameras = drift_of(3, 4, -20, kScale);
  for (size_t c = 0; c < cameras.size(); ++c) EXPECT_EQ(cameras[c].displaced, c == 3) << c;
  EXPECT_NEAR(cameras[3].shift.x(), 4, 1.5);
  EXPECT_NEAR(cameras[3].shift.y(), -20, 1.5);
}

TEST(DisplacedCamera, ignores_a_camera_without_foreground) {
  Rig rig{{"cam0", shapes::camera({3, 0, 0}, {0, 0, 0}, {320, 240}, 500)}};
  DisplacementMeter meter(rig);
  const Mask nothing({320, 240});
  const std::vector<const Mask*> masks{&nothing};
  meter.add(masks, std::vector<Mask>{nothing});
  LeaveOneOutHull hulls(rig, kSpace, 0.05, 1);
  EXPECT_FALSE(meter.result(hulls)[0].displaced);
  EXPECT_EQ(meter.result(hulls)[0].outline_px, 0);
}

}  // namespace
}  // namespace v3d::recon
