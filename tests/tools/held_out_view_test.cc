#include <gtest/gtest.h>

#include <cmath>

#include "base/image/colour.h"
#include "base/image/mask_operations.h"
#include "recon/render/renderer.h"
#include "recon/shapes.h"
#include "v3dctl/evaluate/evaluate.h"

namespace v3d::ctl {
namespace {

constexpr ImageSize kSize{160, 120};

/// Stripes fine enough to cause false colours at the filters of a sensor.
Mesh striped_ball() {
  Mesh ball = recon::shapes::sphere({0, 0, 0}, 0.5F, 60);
  for (const Eigen::Vector3f& v : ball.vertices) {
    const auto grey = static_cast<uint8_t>(128 + 100 * std::sin(90 * v.x()));
    ball.colours.push_back({grey, grey, grey});
  }
  return ball;
}

class HeldOutViews : public testing::Test {
 protected:
  const Mesh ball_ = striped_ball();
  RigCamera camera_{"c", recon::shapes::camera({0, -2, 0.3}, {0, 0, 0}, kSize, 220)};
  const Image drawing_ = recon::draw_mesh(ball_, camera_.model);

  recorded::SegmentedFrame photograph(Image image) const {
    recorded::SegmentedFrame frame;
    frame.raw.image = std::move(image);
    frame.mask = recon::draw_silhouette(ball_, camera_.model);
    return frame;
  }
};

TEST_F(HeldOutViews, have_no_error_from_the_sensor_filters_for_a_perfect_rendering) {
  for (const PixelFormat format : {PixelFormat::kBayerRG8, PixelFormat::kBayerGB8}) {
    const HeldOutView view(camera_, photograph(mosaic(drawing_.view(), format)));
    EXPECT_NE(view.photograph().bytes, drawing_.bytes) << "false colours";
    EXPECT_EQ(view.render(ball_).bytes, view.photograph().bytes);
  }
  const HeldOutView whole_colours(camera_, photograph(drawing_));
  EXPECT_EQ(whole_colours.photograph().bytes, drawing_.bytes);
  EXPECT_EQ(whole_colours.render(ball_).bytes, drawing_.bytes);
}

TEST_F(HeldOutViews, have_no_error_from_the_camera_colours_for_a_perfect_rendering) {
  camera_.colour.black = {9, 4, 6};
  camera_.colour.matrix << 1.1, 0.05, -0.02, 0.03, 1.2, 0, 0, -0.04, 1.15;
  Image recorded = drawing_;
  correct(recorded, camera_.colour.inverse());
  const HeldOutView view(camera_, photograph(mosaic(recorded.view(), PixelFormat::kBayerGR8)));
  const Image drawn = view.render(ball_);
  EXPECT_EQ(drawn.bytes, view.photograph().bytes);
  // In the common colours of the rig, a grey ball is grey.
  const uint8_t* middle = view.photograph().row(60) + 3 * 80;
  EXPECT_NEAR(middle[0], drawing_.row(60)[3 * 80], 30);
}

TEST_F(HeldOutViews, have_pixels_inside_that_show_foreground_only) {
  recorded::SegmentedFrame frame = photograph(drawing_);
  frame.mask = Mask(kSize);
  for (int y = 30; y < 50; ++y) frame.mask.fill_row(y, 40, 70);
  frame.mask.set(55, 40, false);
  const HeldOutView view(camera_, frame);
  for (int y = 0; y < kSize.height; ++y) {
    for (int x = 0; x < kSize.width; ++x) {
      const bool in_middle = x >= 42 && x < 68 && y >= 32 && y < 48;
      const bool hole =
          (y == 40 && (x == 53 || x == 55 || x == 57)) || (x == 55 && (y == 38 || y == 42));
      EXPECT_EQ(view.inside().get(x, y), in_middle && !hole) << x << " " << y;
    }
  }
}

TEST_F(HeldOutViews, have_no_pixels_inside_that_equal_the_plates) {
  recorded::SegmentedFrame frame = photograph(drawing_);
  frame.background_difference = difference_of(frame.mask, frame.mask);
  EXPECT_EQ(HeldOutView(camera_, frame).inside().count(), 0);
  frame.background_difference = frame.mask;
  EXPECT_EQ(HeldOutView(camera_, frame).inside(),
            HeldOutView(camera_, photograph(drawing_)).inside());
}

}  // namespace
}  // namespace v3d::ctl
