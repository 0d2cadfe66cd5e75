#include "recon/visibility/vertex_visibility.h"

#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "recon/shapes.h"
#include "recon/surface/template_windows.h"
#include "support/instruction_sets.h"

namespace v3d::recon {
namespace {

constexpr ImageSize kSize{200, 150};
constexpr VisibilityOptions kOptions{.min_facing = 0.3F, .tolerance_m = 0.01F};

/// A ball half behind another; the mask contains a part of it.
struct Scene {
  Mesh mesh = shapes::sphere({0, 0, 0}, 0.6F, 40);
  CameraModel model;
  Frame frame;
  DepthBuffer depth;
  std::optional<SurfaceCamera> camera;

  explicit Scene(const Distortion& distortion)
      : model(shapes::camera({2, 0.3, 0.2}, {0, 0.1, 0}, kSize, 170, distortion)) {
    shapes::append(mesh, shapes::sphere({0.9F, 0.4F, 0.1F}, 0.2F, 11));
    Image raw(kSize, PixelFormat::kMono8);
    Mask mask(kSize);
    for (int y = 20; y < 130; ++y) mask.fill_row(y, 40, 150 + y % 7);
    frame = observe("cam", {}, raw.view(), mask);
    depth = draw_depth(mesh, model);
    camera.emplace(DeformCamera{&model, &frame});
  }
};

/// Lenses of all three kinds of projection.
const Distortion kLenses[] = {
    {}, {-0.1, 0.02, 0.001, -0.002}, {-0.1, 0.02, 0.001, -0.002, 0.01, 0.02, 0.01, 0.01}};

TEST(VertexVisibility, projects_like_the_camera_bit_for_bit) {
  for (const Distortion& lens : kLenses) {
    const Scene scene(lens);
    std::mt19937 random(5);
    PointBlock points;
    std::vector<Eigen::Vector3f> positions;  // some behind the camera
    const auto along = [&] { return static_cast<float>(random() % 8000) / 1000 - 4; };
    for (points.count = 0; points.count < 379; ++points.count) {
      positions.emplace_back(along(), along(), along());
      points.set(points.count, positions.back());
    }
    on_every_instruction_set([&] {
      PixelBlock pixels;
      project_block(*scene.camera, points, pixels);
      size_t nowhere = 0;
      for (size_t i = 0; i < points.count; ++i) {
        if (const auto expected = scene.camera->project(positions[i])) {
          EXPECT_EQ(pixels.u[i], expected->pixel.x());
          EXPECT_EQ(pixels.v[i], expected->pixel.y());
          EXPECT_EQ(pixels.z[i], expected->z);
        } else {
          EXPECT_TRUE(std::isnan(pixels.u[i]) && std::isnan(pixels.v[i]));
          ++nowhere;
        }
      }
      EXPECT_GT(nowhere, 20);
      EXPECT_LT(nowhere, 360);
    });
  }
}

/// A slanted surface is seen slightly behind its occluder.
bool is_seen(const Scene& scene, const SurfaceCamera::Seen& at, float facing) {
  if (!(facing >= kOptions.min_facing)) return false;
  const float slope = std::sqrt(std::max(0.0F, 1 - facing * facing)) / facing;
  const float slant = scene.camera->pixel_m_per_m() * at.z * std::min(slope, 6.0F);
  return scene.camera->sees(at, scene.depth, kOptions.tolerance_m + slant);
}

TEST(VertexVisibility, finds_facing_and_unoccluded_vertices_bit_for_bit) {
  for (const Distortion& lens : kLenses) {
    const Scene scene(lens);
    const std::vector<Eigen::Vector3f> normals = vertex_normals(scene.mesh);
    on_every_instruction_set([&] {
      size_t seen = 0, hidden = 0;
      for (size_t first = 0; first < normals.size(); first += VertexVisibility::kCapacity) {
        PointBlock positions, directions;
        positions.count = std::min(VertexVisibility::kCapacity, normals.size() - first);
        for (size_t i = 0; i < positions.count; ++i) {
          positions.set(i, scene.mesh.vertices[first + i]);
          directions.set(i, normals[first + i]);
        }
        VertexVisibility visibility;
        test_visibility(*scene.camera, scene.depth, positions, directions, kOptions, visibility);
        for (size_t i = 0; i < positions.count; ++i) {
          const Eigen::Vector3f& position = scene.mesh.vertices[first + i];
          const Eigen::Vector3f way = scene.camera->center() - position;
          const float facing = way.dot(normals[first + i]) / way.norm();
          const SurfaceCamera::Seen at = scene.camera->project(position).value();
          EXPECT_EQ(visibility.at(i).pixel, at.pixel);
          EXPECT_EQ(visibility.z[i], at.z);
          EXPECT_EQ(visibility.facing[i], facing);
          const bool expected = is_seen(scene, at, facing);
          EXPECT_EQ(visibility.seen[i], expected ? facing : -2);
          (expected ? seen : hidden) += facing >= kOptions.min_facing;
        }
      }
      EXPECT_GT(seen, 100);
      EXPECT_GT(hidden, 100);
    });
  }
}

TEST(VertexVisibility, finds_obliquely_seen_vertices_at_given_pixels) {
  const Scene scene({});
  std::mt19937 random(9);
  VertexVisibility visibility;
  const auto along = [&] { return static_cast<float>(random() % 2600) / 10 - 30; };
  for (size_t i = 0; i < VertexVisibility::kCapacity; ++i) {
    visibility.u[i] = i % 9 == 0 ? std::nanf("") : along();
    visibility.v[i] = along();
    visibility.facing[i] = static_cast<float>(random() % 200) / 100 - 1;
  }
  on_every_instruction_set([&] {
    for (const size_t count : {size_t{0}, size_t{77}, VertexVisibility::kCapacity}) {
      VertexBits expected{};
      for (size_t i = 0; i < count; ++i) {
        const bool found = std::abs(visibility.facing[i]) <= 0.5F &&
                           scene.camera->in_silhouette({visibility.u[i], visibility.v[i]});
        expected[i / 64] |= uint64_t{found} << (i % 64);
      }
      EXPECT_TRUE(count == 0 || expected[0] != 0);
      EXPECT_EQ(grazing_vertices(scene.camera->silhouette(), visibility, count, 0.5F), expected);
    }
  });
}

TEST(WindowBlock, lists_the_cameras_that_a_vertex_faces_most_up_to_the_limit) {
  const Scene scene({});
  const std::vector<SurfaceCamera> cameras(3, *scene.camera);
  std::vector<VertexVisibility> visibilities(3);
  const std::vector<Eigen::Vector3f> positions{{0.6F, 0, 0}, {0.6F, 0, 0}}, normals(2, {1, 0, 0});
  const auto at = scene.camera->project(positions[0]).value();
  for (size_t c = 0; c < 3; ++c) {
    for (size_t i = 0; i < 2; ++i) {
      visibilities[c].u[i] = at.pixel.x() + static_cast<float>(c);
      visibilities[c].v[i] = at.pixel.y();
      visibilities[c].seen[i] = std::array{0.5F, 0.9F, 0.7F}[c];
    }
  }
  WindowBlock windows;
  windows.find(positions, normals, cameras, visibilities,
               {.max_views = 2, .every = 2, .spacing_m = 0.01F, .step_m = 0.005F}, {.side = 5});
  ASSERT_EQ(windows.views(0).count, 2);
  const auto middle = [&](int k) {
    return windows.views(0).view[k].u + cameras[0].picture(0).first_u() - at.pixel.x();
  };
  EXPECT_NEAR(middle(0), 1, 1e-4);
  EXPECT_NEAR(middle(1), 2, 1e-4);
  EXPECT_EQ(windows.views(1).count, 0) << "only every second has a window";
}

}  // namespace
}  // namespace v3d::recon
