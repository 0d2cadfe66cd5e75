#include <gtest/gtest.h>

#include <cmath>

#include "base/image/colour.h"
#include "recon/render/renderer.h"
#include "recon/shapes.h"
#include "recon/texture/texture.h"

namespace v3d::recon {
namespace {

constexpr ImageSize kSize{120, 90};

/// Cameras round a ball, of these names.
struct Scene {
  Mesh mesh = shapes::sphere({0, 0, 1}, 0.4F, 16);
  std::vector<CameraModel> models;
  std::vector<Frame> frames;

  explicit Scene(const std::vector<std::string>& names) {
    for (size_t c = 0; c < names.size(); ++c) {
      const double angle = static_cast<double>(c);
      models.push_back(shapes::camera({2 * std::cos(angle), 2 * std::sin(angle), 1}, {0, 0, 1},
                                      kSize, 150 + 30 * angle));
      frames.push_back(observe(names[c], {}, Image(kSize, PixelFormat::kBayerRG8).view(),
                               draw_silhouette(mesh, models.back())));
    }
  }

  std::vector<VertexCamera> prepared(const TextureOptions& options = {},
                                     const ColourResponse* colour = nullptr) const {
    std::vector<TextureCamera> cameras;
    for (size_t c = 0; c < models.size(); ++c) cameras.push_back({&models[c], &frames[c], colour});
    return vertex_cameras(PointArrays(mesh.vertices), cameras, options);
  }
};

TEST(VertexCameras, are_sorted_by_name_and_have_pixels) {
  Scene scene({"cam03", "cam01", "cam04", "cam02"});
  scene.frames[2] = observe("cam04", {}, Image(kSize, PixelFormat::kBayerRG8).view(), Mask(kSize));
  const auto cameras = scene.prepared();
  ASSERT_EQ(cameras.size(), 3U);
  EXPECT_EQ(cameras[0].frame, &scene.frames[1]);
  EXPECT_EQ(cameras[1].frame, &scene.frames[3]);
  EXPECT_EQ(cameras[2].frame, &scene.frames[0]);
  EXPECT_LT((cameras[2].axis - scene.models[0].viewing_direction().cast<float>()).norm(), 1e-6);
}

TEST(VertexCameras, contain_the_depth_of_the_surface) {
  const Scene scene({"cam01"});
  const VertexCamera camera = scene.prepared().front();
  float nearest = std::numeric_limits<float>::infinity();
  for (int cell = 0; cell < camera.depth.grid().count(); ++cell) {
    nearest = std::min(nearest, camera.depth.nearest()[cell]);
  }
  EXPECT_NEAR(nearest, 2 - 0.4, 0.01);
  EXPECT_NEAR(camera.cell_m_per_m, camera.depth.grid().cell_width() / 150, 1e-6);
}

TEST(VertexCameras, are_weighted_by_angle_only_by_default) {
  const Scene scene({"cam01"});
  const VertexCamera camera = scene.prepared().front();
  EXPECT_FALSE(camera.weight);
  EXPECT_EQ(camera.resolution, 0);
  EXPECT_FALSE(camera.demosaiced);
  EXPECT_FALSE(camera.colour);
}

TEST(VertexCameras, are_weighted_by_pixels_when_resolution_counts) {
  const auto cameras = Scene({"cam01", "cam02"}).prepared({.by_resolution = true});
  EXPECT_NEAR(cameras[0].resolution, 150.0 / 300, 1e-6);
  EXPECT_NEAR(cameras[1].resolution, 180.0 / 300, 1e-6);
}

TEST(VertexCameras, have_the_largest_weight_in_the_direction_of_the_viewpoint) {
  const Scene scene({"cam01", "cam02"});
  TextureOptions options;
  options.view = ViewDependence{scene.models[1].viewing_direction(), 10};
  const auto cameras = scene.prepared(options);
  EXPECT_NEAR(*cameras[1].weight, 1, 1e-6);
  const double cosine = options.view->direction.dot(scene.models[0].viewing_direction());
  EXPECT_NEAR(*cameras[0].weight, std::pow((cosine + 2) / 3, 10), 1e-6);
}

TEST(VertexCameras, demosaic_and_correct_colours_on_request) {
  const Scene scene({"cam01"});
  ColourResponse identity, warm;
  warm.matrix(0, 0) = 1.1;
  TextureOptions options;
  options.demosaic = true;
  const VertexCamera camera = scene.prepared(options, &warm).front();
  ASSERT_TRUE(camera.demosaiced);
  EXPECT_EQ(camera.demosaiced->bytes, to_rgb(scene.frames[0].image.view()).bytes);
  EXPECT_TRUE(camera.colour);
  EXPECT_FALSE(scene.prepared(options, &identity).front().colour);
}

}  // namespace
}  // namespace v3d::recon
