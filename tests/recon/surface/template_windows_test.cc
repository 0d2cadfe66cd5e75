#include "recon/surface/template_windows.h"

#include <gtest/gtest.h>

#include "recon/render/renderer.h"
#include "recon/shapes.h"

namespace v3d::recon {
namespace {

using Eigen::Vector2f;
using Eigen::Vector3f;

constexpr ImageSize kSize{240, 180};
constexpr WindowOptions kOptions{.max_views = 3, .spacing_m = 0.004F, .step_m = 0.005F};
constexpr CorrelationOptions kCorrelation{.side = 5, .first = -8};

/// Cameras above a large plate, each farther aside than the previous one.
struct Scene {
  Mesh plate = shapes::patch(0.6F, 0, 30);
  std::vector<CameraModel> models;
  std::vector<Frame> frames;
  std::vector<SurfaceCamera> cameras;
  std::vector<VertexVisibility> visibilities;
  WindowBlock windows;

  explicit Scene(const std::vector<double>& aside) {
    for (const double x : aside)
      models.push_back(shapes::camera({x, 0.1, 2}, {0, 0, 0}, kSize, 300));
    for (const Mask& mask : draw_silhouettes(plate, models)) {
      frames.push_back(observe("cam", {}, Image(kSize, PixelFormat::kMono8).view(), mask));
    }
    for (size_t c = 0; c < models.size(); ++c) {
      cameras.emplace_back(DeformCamera{&models[c], &frames[c]});
    }
  }

  /// Of windows at these positions of the plate.
  void find(const std::vector<Vector3f>& positions, const WindowOptions& options = kOptions) {
    const std::vector<Vector3f> normals(positions.size(), Vector3f::UnitZ());
    PointBlock where, facing;
    where.count = facing.count = positions.size();
    for (size_t i = 0; i < positions.size(); ++i) {
      where.set(i, positions[i]);
      facing.set(i, normals[i]);
    }
    visibilities.resize(cameras.size());
    for (size_t c = 0; c < cameras.size(); ++c) {
      test_visibility(cameras[c], draw_depth(plate, models[c]), where, facing,
                      {.tolerance_m = 0.01F}, visibilities[c]);
    }
    windows.find(positions, normals, cameras, visibilities, options, kCorrelation);
  }
};

std::vector<uint32_t> cameras_of(const WindowViews& views) {
  return {views.camera.begin(), views.camera.begin() + views.count};
}

TEST(TemplateWindows, are_sampled_first_by_the_cameras_they_face_most) {
  Scene scene({1.2, 0, 0.8, -0.4});
  scene.find({{0, 0, 0}});
  EXPECT_EQ(cameras_of(scene.windows.views(0)), (std::vector<uint32_t>{1, 3, 2}))
      << "no more than three";
}

TEST(TemplateWindows, omit_cameras_that_do_not_see_them) {
  Scene scene({0.3, -0.2, 0.1});
  for (const int y : {88, 89, 90, 91}) {
    for (int x = 0; x < kSize.width; ++x) scene.frames[1].mask->set(x, y, false);
  }
  scene.find({{0, 0, 0}});
  EXPECT_EQ(cameras_of(scene.windows.views(0)), (std::vector<uint32_t>{2, 0}));
}

/// The axes and the outward direction of a window equal the projections of points beside its
/// centre.
TEST(TemplateWindows, project_into_images_by_the_lens_model) {
  Scene scene({0.4, -0.3});
  const Vector3f position(0.05F, -0.08F, 0);
  for (const int level : {0, 1}) {
    WindowOptions options = kOptions;
    options.level = level;
    scene.find({position}, options);
    const WindowViews& views = scene.windows.views(0);
    ASSERT_EQ(views.count, 2);
    for (int k = 0; k < views.count; ++k) {
      const WindowView& view = views.view[k];
      const SurfaceCamera& camera = scene.cameras[views.camera[k]];
      const Luminance& picture = camera.picture(level);
      ASSERT_EQ(view.image, &picture);
      const auto in_picture = [&](const Vector3f& at) {
        return Vector2f(camera.project(at)->pixel * picture.scale() -
                        Vector2f(picture.first_u(), picture.first_v()));
      };
      const Vector2f middle = in_picture(position);
      EXPECT_LT((Vector2f(view.u, view.v) - middle).norm(), 1e-3);
      const Vector2f out = in_picture(position + Vector3f(0, 0, options.step_m)) - middle;
      EXPECT_LT((Vector2f(view.u_out, view.v_out) - out).norm(), 1e-3);
      // The axes in the plane are not specified: two of one step at a right angle.
      const Vector2f x = in_picture(position + Vector3f(options.spacing_m, 0, 0)) - middle;
      const Vector2f y = in_picture(position + Vector3f(0, options.spacing_m, 0)) - middle;
      const float across = view.u_across * view.v_down - view.v_across * view.u_down;
      EXPECT_NEAR(std::abs(across), std::abs(x.x() * y.y() - x.y() * y.x()),
                  0.02F * std::abs(across));
    }
  }
}

TEST(TemplateWindows, are_absent_when_their_corners_leave_the_silhouette) {
  Scene scene({0.05, -0.3});
  // A window reaches 8 mm to each side.
  scene.find({{0.585F, 0.1F, 0}, {0.596F, 0.1F, 0}, {0, 0, 0}});
  EXPECT_EQ(scene.windows.views(0).count, 2);
  EXPECT_EQ(scene.windows.views(1).count, 0);
  EXPECT_EQ(scene.windows.views(2).count, 2);
}

TEST(TemplateWindows, are_made_for_every_nth_vertex_of_a_block) {
  Scene scene({0.1, -0.3});
  WindowOptions options = kOptions;
  options.every = 3;
  std::vector<Vector3f> positions(VertexVisibility::kCapacity, Vector3f(0.01F, 0, 0));
  scene.find(positions, options);
  for (size_t i = 0; i < positions.size(); ++i) {
    EXPECT_EQ(scene.windows.views(i).count, i % 3 == 0 ? 2 : 0) << i;
  }
  scene.find(positions);
  EXPECT_EQ(scene.windows.views(1).count, 2);
}

}  // namespace
}  // namespace v3d::recon
