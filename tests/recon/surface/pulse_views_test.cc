#include <gtest/gtest.h>

#include "recon/render/renderer.h"
#include "recon/shapes.h"
#include "recon/surface/temporal_smoothing.h"
#include "recon/visibility/depth_buffer.h"

namespace v3d::recon {
namespace {

constexpr double kVoxel = 0.01;

/// A rig of four cameras that see a ball.
class PulseViewsTest : public testing::Test {
 protected:
  PulseViewsTest() {
    for (int c = 0; c < 4; ++c) {
      models_.push_back(shapes::camera({2 * std::cos(1.5 * c), 2 * std::sin(1.5 * c), 1},
                                       {0, 0, 0.5}, {100, 80 + 2 * c}, 90));
      frames_.push_back(observe("cam", {}, Image(models_[c].size(), PixelFormat::kMono8).view(),
                                draw_silhouette(ball_, models_[c])));
    }
  }
  /// The views of a pulse; these cameras have no frame.
  PulseViews without(const std::vector<size_t>& missing) const {
    std::vector<const Frame*> frames;
    for (const Frame& frame : frames_) frames.push_back(&frame);
    for (const size_t c : missing) frames[c] = nullptr;
    return {models_, frames, ball_, kVoxel};
  }
  /// Number of a camera of the rig, by its centre; -1 for none.
  int number_of(const SurfaceCamera* camera) const {
    for (size_t c = 0; camera != nullptr && c < models_.size(); ++c) {
      if ((camera->center() - models_[c].center().cast<float>()).norm() < 1e-4F) {
        return static_cast<int>(c);
      }
    }
    return -1;
  }

  const Mesh ball_ = shapes::sphere({0, 0, 0.5F}, 0.4F, 16);
  std::vector<CameraModel> models_;
  std::vector<Frame> frames_;
};

TEST_F(PulseViewsTest, have_a_view_of_each_camera_with_an_image_in_the_order_of_the_rig) {
  frames_[3].roi = {};
  PulseViews views = without({1});
  EXPECT_EQ(views.cameras(), 4U);
  const SurfaceCameras& seen = views.cameras_with_pixels();
  ASSERT_EQ(seen.cameras.size(), 2U);
  EXPECT_EQ(number_of(&seen.cameras[0]), 0);
  EXPECT_EQ(number_of(&seen.cameras[1]), 2);
  views.set_surface(ball_);
  EXPECT_FALSE(views.view(1)) << "a null frame";
  EXPECT_FALSE(views.view(3)) << "an empty frame";
  for (const size_t c : {0, 2}) {
    const auto view = views.view(c);
    ASSERT_TRUE(view);
    EXPECT_EQ(number_of(&view->camera), static_cast<int>(c));
  }
}

TEST_F(PulseViewsTest, have_the_depths_of_the_last_surface) {
  PulseViews views = without({0});
  for (const float radius : {0.4F, 0.2F}) {
    const Mesh surface = shapes::sphere({0, 0, 0.5F}, radius, 16);
    views.set_surface(surface);
    for (size_t c = 1; c < 4; ++c) {
      const CameraModel& model = views.cameras_with_pixels().models[c - 1];
      EXPECT_EQ(views.view(c)->depth.z, draw_depth(surface, model, Faces::kFront).z) << c;
    }
  }
}

TEST_F(PulseViewsTest, survive_the_frames_that_they_were_made_of_and_a_move) {
  PulseViews first = without({2});
  for (Frame& frame : frames_) frame = {};
  PulseViews views = std::move(first);
  views.set_surface(ball_);
  const auto middle = views.view(1)->camera.project(Eigen::Vector3f(0, 0, 0.5F));
  ASSERT_TRUE(middle);
  EXPECT_TRUE(views.view(1)->camera.in_silhouette(middle->pixel));
}

TEST_F(PulseViewsTest, pair_the_cameras_of_two_pulses_by_their_place_in_the_rig) {
  const PulseViews now = without({0, 3}), then = without({1});
  const NeighbourSamples samples = neighbour_samples(now, then);
  EXPECT_EQ(samples.samples, &then.stereo_samples);
  const std::vector<std::pair<int, int>> expected{{0, -1}, {2, 2}, {3, -1}};
  std::vector<std::pair<int, int>> found;
  for (const auto& camera : samples.cameras) {
    found.emplace_back(number_of(camera.then), number_of(camera.now));
  }
  EXPECT_EQ(found, expected);
}

}  // namespace
}  // namespace v3d::recon
