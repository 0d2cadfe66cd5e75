#include "recon/visibility/surface_camera.h"

#include <gtest/gtest.h>

#include <random>

#include "recon/render/renderer.h"
#include "recon/shapes.h"
#include "recon/surface/temporal_smoothing.h"

namespace v3d::recon {
namespace {

using Eigen::Vector3f;

constexpr ImageSize kSize{200, 150};

CameraModel model_with(const Distortion& lens) {
  return shapes::camera({2, 0.3, 1.2}, {0, 0, 1}, kSize, 170, lens);
}

Mesh ball() { return shapes::sphere({0, 0, 1}, 0.4F, 20); }

Frame frame_of(const CameraModel& model, const Mesh& mesh) {
  return observe("cam", {}, Image(model.size(), PixelFormat::kMono8).view(),
                 draw_silhouette(mesh, model));
}

TEST(SurfaceCamera, projects_points_by_the_whole_lens_model) {
  for (const Distortion& lens : {Distortion{}, Distortion{-0.1, 0.02, 0.001, -0.002}}) {
    const CameraModel model = model_with(lens);
    const Frame frame = frame_of(model, ball());
    const SurfaceCamera camera({&model, &frame});
    std::mt19937 random(4);
    std::uniform_real_distribution<float> along(-1, 1);
    for (int i = 0; i < 500; ++i) {
      const Vector3f position(along(random), along(random), 1 + along(random));
      const auto expected = model.project(position.cast<double>());
      const auto found = camera.project(position);
      ASSERT_EQ(found.has_value(), expected.has_value());
      if (!found) continue;
      // The middle of the first pixel is (0, 0) there and (0.5, 0.5) here.
      EXPECT_LT((found->pixel.cast<double>() - *expected - Eigen::Vector2d(0.5, 0.5)).norm(), 0.02);
      EXPECT_NEAR(found->z, (model.cam_from_world() * position.cast<double>()).z(), 1e-5);
    }
    EXPECT_FALSE(camera.project({4, 0.6F, 1.4F})) << "behind the camera";
  }
}

TEST(SurfaceCamera, tests_points_against_the_pixels_of_the_mask) {
  const CameraModel model = model_with({});
  Frame frame = frame_of(model, ball());
  const SurfaceCamera camera({&model, &frame});
  for (int y = -2; y < kSize.height + 2; ++y) {
    for (int x = -2; x < kSize.width + 2; ++x) {
      const bool exists = x >= 0 && y >= 0 && x < kSize.width && y < kSize.height;
      const Eigen::Vector2f middle(static_cast<float>(x) + 0.5F, static_cast<float>(y) + 0.5F);
      EXPECT_EQ(camera.in_silhouette(middle), exists && frame.mask->get(x, y));
    }
  }
}

TEST(SurfaceCamera, sees_points_that_the_surface_does_not_hide) {
  const CameraModel model = model_with({});
  const Frame frame = frame_of(model, ball());
  const SurfaceCamera camera({&model, &frame});
  const DepthBuffer depth = draw_depth(ball(), model);
  const Vector3f to_camera = (camera.center() - Vector3f(0, 0, 1)).normalized();
  const auto at = [&](float radius) {
    return camera.project(Vector3f(0, 0, 1) + radius * to_camera).value();
  };
  EXPECT_TRUE(camera.sees(at(0.4F), depth, 0.01F)) << "on the surface";
  EXPECT_TRUE(camera.sees(at(0.395F), depth, 0.01F)) << "behind it by less than the tolerance";
  EXPECT_FALSE(camera.sees(at(0.37F), depth, 0.01F)) << "inside";
  EXPECT_FALSE(camera.sees(at(-0.4F), depth, 0.01F)) << "on the far side";
  const auto beside = camera.project({0, 0.7F, 1}).value();
  EXPECT_FALSE(camera.sees(beside, depth, 0.01F)) << "no foreground";
}

TEST(RedundantHalvings, end_when_pixels_are_as_wide_as_a_quarter_of_a_voxel) {
  // At 2 m a pixel covers 2 / 170 m = 11.8 mm.
  const CameraModel model = shapes::camera({2, 0, 1}, {0, 0, 1}, kSize, 170);
  const Vector3f middle(0, 0, 1);
  EXPECT_EQ(redundant_halvings(model, middle, 0.040), 0);
  EXPECT_EQ(redundant_halvings(model, middle, 0.048), 1);
  EXPECT_EQ(redundant_halvings(model, middle, 0.094), 1);
  EXPECT_EQ(redundant_halvings(model, middle, 0.096), 2);
  EXPECT_EQ(redundant_halvings(model, middle, 1e9), 8) << "at most";
  EXPECT_EQ(redundant_halvings(model, {3, 0, 1}, 1), 0) << "behind the camera";
}

TEST(SurfaceCameras, omit_cameras_without_foreground) {
  const std::vector<CameraModel> models(3, model_with({}));
  std::vector<Frame> frames(3, frame_of(models[0], ball()));
  frames[1] = frame_of(models[1], Mesh{});
  std::vector<DeformCamera> given;
  for (size_t c = 0; c < 3; ++c) given.push_back({&models[c], &frames[c]});
  const SurfaceCameras cameras(given, ball(), 0.01);
  ASSERT_EQ(cameras.cameras.size(), 2U);
  ASSERT_EQ(cameras.models.size(), 2U);
  EXPECT_EQ(&cameras.cameras[0].silhouette(), &*frames[0].mask);
  EXPECT_EQ(&cameras.cameras[1].silhouette(), &*frames[2].mask);
}

TEST(SurfaceCameras, have_a_resolution_that_fits_the_voxels) {
  const CameraModel model = model_with({});
  const Frame frame = frame_of(model, ball());
  const DeformCamera given{&model, &frame};
  EXPECT_EQ(SurfaceCameras({&given, 1}, ball(), 0.01).cameras[0].coarseness(), 1);
  EXPECT_EQ(SurfaceCameras({&given, 1}, ball(), 0.09).cameras[0].coarseness(), 2);
}

TEST(VertexCentroid, a_mesh_is_the_mean_of_its_vertices) {
  EXPECT_LT((vertex_centroid(ball()) - Vector3f(0, 0, 1)).norm(), 1e-5);
  EXPECT_EQ(vertex_centroid(Mesh{}), Vector3f::Zero());
}

/// Three cameras of a rig at one pulse. Those in `blind` have no frame.
struct Pulse {
  std::vector<CameraModel> models;
  std::vector<Frame> frames;
  std::optional<PulseViews> views;

  explicit Pulse(const std::vector<size_t>& blind) : models(3, model_with({})), frames(3) {
    std::vector<const Frame*> seen;
    for (size_t c = 0; c < 3; ++c) {
      frames[c] = frame_of(models[c], ball());
      seen.push_back(std::ranges::find(blind, c) == blind.end() ? &frames[c] : nullptr);
    }
    views.emplace(models, seen, ball(), 0.01);
  }
};

TEST(PulseViews, contain_one_view_for_each_camera_with_foreground) {
  Pulse pulse({1});
  pulse.frames.clear();  // PulseViews has copied them
  PulseViews& views = *pulse.views;
  views.set_surface(ball());
  ASSERT_EQ(views.cameras(), 3U);
  EXPECT_EQ(views.cameras_with_pixels().cameras.size(), 2U);
  EXPECT_FALSE(views.view(1));
  for (const size_t camera : {0, 2}) {
    const auto view = views.view(camera);
    ASSERT_TRUE(view);
    EXPECT_GT(view->camera.silhouette().count(), 1000);
    EXPECT_EQ(view->depth.z, draw_depth(ball(), pulse.models[camera], Faces::kFront).z);
  }
  EXPECT_EQ(&views.view(2)->camera, &views.cameras_with_pixels().cameras[1]);
}

TEST(NeighbourSamples, pair_the_cameras_of_two_pulses_by_the_rig) {
  const Pulse then({0}), now({1});
  const NeighbourSamples beside = neighbour_samples(*now.views, *then.views);
  EXPECT_EQ(beside.samples, &then.views->stereo_samples);
  ASSERT_EQ(beside.cameras.size(), 2U) << "those that saw something then: 1 and 2 of the rig";
  EXPECT_EQ(beside.cameras[0].then, &then.views->cameras_with_pixels().cameras[0]);
  EXPECT_EQ(beside.cameras[0].now, nullptr) << "camera 1 sees nothing now";
  EXPECT_EQ(beside.cameras[1].then, &then.views->cameras_with_pixels().cameras[1]);
  EXPECT_EQ(beside.cameras[1].now, &now.views->cameras_with_pixels().cameras[1]);
}

}  // namespace
}  // namespace v3d::recon
