#include "recon/metrics/frame_quality.h"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "base/geometry/rigid_transform.h"
#include "base/image/mask_operations.h"
#include "recon/render/renderer.h"
#include "recon/shapes.h"

namespace v3d::recon {
namespace {

const Box kSpace{{-0.6, -0.6, -0.6}, {0.6, 0.6, 0.6}};

/// Six cameras around a ball, with its silhouettes.
class FrameQualityTest : public testing::Test {
 protected:
  FrameQualityTest() {
    for (int i = 0; i < 6; ++i) {
      const double angle = std::numbers::pi * i / 3;
      rig_.push_back({"cam" + std::to_string(i),
                      shapes::camera({3 * std::cos(angle), 3 * std::sin(angle), 0.5}, {0, 0, 0},
                                     {320, 240}, 400)});
    }
    for (const Mask& mask : draw_silhouettes(ball_, models_of(rig_))) {
      Frame frame;
      frame.mask = mask;
      frames_.push_back(frame);
    }
  }

  FrameQuality measure(const Mesh& mesh) const {
    std::vector<const Frame*> all;
    for (const Frame& frame : frames_) all.push_back(frame.mask ? &frame : nullptr);
    return QualityMeter(rig_, kSpace, 0.06).measure(mesh, all);
  }

  const Mesh ball_ = shapes::sphere({0, 0, 0}, 0.4F, 48);
  Rig rig_;
  std::vector<Frame> frames_;
};

TEST_F(FrameQualityTest, is_one_where_the_surface_explains_every_silhouette) {
  const FrameQuality quality = measure(ball_);
  EXPECT_EQ(quality.silhouette_iou, 1);
  EXPECT_EQ(quality.coverage, 1);
  EXPECT_EQ(quality.cameras, 6);
}

TEST_F(FrameQualityTest, decreases_with_missing_surface) {
  const FrameQuality quality = measure(shapes::sphere({0, 0, 0}, 0.3F, 48));
  EXPECT_GT(quality.coverage, 9.0 / 16);
  EXPECT_LT(quality.coverage, 0.75) << "cells reach a little beyond the surface";
  EXPECT_NEAR(quality.silhouette_iou, quality.coverage, 0.02);
}

TEST_F(FrameQualityTest, decreases_with_excess_surface_at_full_coverage) {
  const FrameQuality quality = measure(shapes::sphere({0, 0, 0}, 0.55F, 48));
  EXPECT_EQ(quality.coverage, 1);
  EXPECT_LT(quality.silhouette_iou, 0.8);
}

TEST_F(FrameQualityTest, uses_only_participating_cameras_and_pixels_of_the_space) {
  frames_[2].mask.reset();
  for (int y = 0; y < 30; ++y) frames_[4].mask->fill_row(y, 0, 30);  // outside the space
  const FrameQuality quality = measure(ball_);
  EXPECT_EQ(quality.cameras, 5);
  EXPECT_EQ(quality.silhouette_iou, 1);
}

TEST_F(FrameQualityTest, is_one_without_silhouettes_and_zero_without_a_surface) {
  EXPECT_EQ(measure(Mesh()).silhouette_iou, 0);
  for (Frame& frame : frames_) frame.mask = Mask(frame.mask->size());
  EXPECT_EQ(measure(Mesh()).silhouette_iou, 1);
}

}  // namespace
}  // namespace v3d::recon
