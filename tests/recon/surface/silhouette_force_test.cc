#include <gtest/gtest.h>

#include <cmath>

#include "recon/render/renderer.h"
#include "recon/shapes.h"
#include "recon/surface/deform.h"

namespace v3d::recon {
namespace {

using Eigen::Vector3f;

constexpr ImageSize kSize{240, 200};
constexpr float kRadius = 0.4F;
const Vector3f kMiddle(0, 0, 1);

Mesh ball(float radius) { return shapes::sphere(kMiddle, radius, 40); }

/// The mesh of a ball of kRadius, and a camera that observes one of radius `observed` metres.
struct Scene {
  CameraModel model = shapes::camera({3, 0, 1}, {0, 0, 1}, kSize, 600);
  Mesh mesh = ball(kRadius);
  Frame frame;
  DepthBuffer depth = draw_depth(mesh, model);
  std::optional<SurfaceCamera> camera;

  explicit Scene(float observed, int halvings = 0) {
    frame = observe("cam", {}, Image(kSize, PixelFormat::kMono8).view(),
                    draw_silhouette(ball(observed), model));
    camera.emplace(DeformCamera{&model, &frame}, halvings);
  }

  /// Mean over the vertices whose normals are perpendicular to the direction to the camera.
  std::vector<std::optional<float>> ways() const {
    std::vector<std::optional<float>> found;
    for (const Vector3f& v : mesh.vertices) {
      const Vector3f normal = (v - kMiddle).normalized(), way = camera->center() - v;
      // The outline of a ball is slightly in front of its centre.
      if (std::abs(normal.dot(way.normalized())) > 0.02F) continue;
      const auto seen = camera->project(v);
      found.push_back(silhouette_displacement(*camera, depth, v, normal, seen.value()));
    }
    return found;
  }
};

/// Width of a pixel at the outline, metres.
constexpr float kPixelM = 3.0F / 600;

TEST(SilhouetteDisplacement, is_how_much_larger_or_smaller_the_observed_ball_is) {
  for (const float more : {-0.02F, 0.0F, 0.015F, 0.03F}) {
    const Scene scene(kRadius + more);
    const auto ways = scene.ways();
    ASSERT_GT(ways.size(), 10U);
    double sum = 0;
    for (const auto& way : ways) {
      ASSERT_TRUE(way) << more;
      EXPECT_NEAR(*way, more, 1.5F * kPixelM);
      sum += *way;
    }
    EXPECT_NEAR(sum / static_cast<double>(ways.size()), more, 0.3F * kPixelM);
  }
}

TEST(SilhouetteDisplacement, is_zero_to_the_bit_for_a_mesh_that_fills_its_silhouette) {
  const Scene scene(kRadius);
  for (const auto& way : scene.ways()) EXPECT_EQ(way, 0.0F);
}

TEST(SilhouetteDisplacement, needs_no_depth_buffer_for_a_vertex_on_the_outline) {
  for (const float more : {-0.02F, 0.0F, 0.015F, 0.03F}) {
    const Scene scene(kRadius + more);
    const Mask near = near_silhouette_outline(*scene.camera);
    int found = 0;
    for (const Vector3f& v : scene.mesh.vertices) {
      const Vector3f normal = (v - kMiddle).normalized(), way = scene.camera->center() - v;
      if (std::abs(normal.dot(way.normalized())) > 0.02F) continue;
      const auto seen = scene.camera->project(v).value();
      EXPECT_TRUE(near.get(static_cast<int>(seen.pixel.x()), static_cast<int>(seen.pixel.y())));
      const auto displacement = displacement_to_silhouette(*scene.camera, v, normal, seen);
      ASSERT_TRUE(displacement) << more;
      EXPECT_NEAR(*displacement, more, 1.5F * kPixelM);
      ++found;
    }
    EXPECT_GT(found, 10);
  }
}

TEST(SilhouetteDisplacement, is_zero_without_a_near_observed_outline) {
  const Scene scene(kRadius + 12 * kPixelM);
  for (const auto& way : scene.ways()) EXPECT_FALSE(way);
  const Scene coarse(kRadius + 12 * kPixelM, 1);
  for (const auto& way : coarse.ways()) EXPECT_TRUE(way) << "pixels are twice as wide";
}

TEST(SilhouetteDisplacement, is_none_for_a_vertex_that_is_not_on_the_outline) {
  const Scene scene(kRadius + 0.02F);
  const Vector3f normal(0, 0, 1), inside = kMiddle + 0.9F * kRadius * normal;
  EXPECT_FALSE(silhouette_displacement(*scene.camera, scene.depth, inside, normal,
                                       scene.camera->project(inside).value()));
}

TEST(SilhouetteDisplacement, is_none_at_the_border_of_the_picture) {
  Scene scene(kRadius);
  const Vector3f normal(0, 0, 1), position(0, 0, 1.49F);  // two pixels below the upper border
  const auto seen = scene.camera->project(position).value();
  ASSERT_GT(seen.pixel.y(), 0);
  ASSERT_LT(seen.pixel.y(), 9);
  EXPECT_FALSE(silhouette_displacement(*scene.camera, scene.depth, position, normal, seen));
}

TEST(NearOutline, contains_every_pixel_within_two_of_the_outline_and_no_far_one) {
  for (const int halvings : {0, 1}) {
    const Scene scene(kRadius, halvings);
    const Mask near = near_outline(*scene.camera, scene.depth);
    const auto drawn = [&](int x, int y) { return std::isfinite(scene.depth.at(x, y)); };
    const int within = 2 << halvings;
    for (int y = 8; y < kSize.height - 8; ++y) {
      for (int x = 8; x < kSize.width - 8; ++x) {
        const auto changes = [&](int reach) {
          for (int d = -reach; d <= reach; ++d) {
            if (drawn(x + d, y) != drawn(x, y) || drawn(x, y + d) != drawn(x, y)) return true;
          }
          return false;
        };
        ASSERT_TRUE(!changes(within) || near.get(x, y)) << x << " " << y;
      }
    }
    EXPECT_FALSE(near.get(kSize.width / 2, kSize.height / 2));
    EXPECT_FALSE(near.get(4, 4));
    EXPECT_LT(near.count(), (halvings + 1) * 4'000);
  }
}

}  // namespace
}  // namespace v3d::recon
