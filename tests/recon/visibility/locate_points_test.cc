#include <gtest/gtest.h>

#include <random>

#include "recon/render/rasteriser.h"
#include "recon/shapes.h"
#include "recon/visibility/point_depth_buffer.h"
#include "support/instruction_sets.h"

namespace v3d::recon {
namespace {

constexpr ImageSize kSize{200, 150};
constexpr CellGrid kGrid{.first_u = 20.25F,
                         .first_v = 10.5F,
                         .cells_per_pixel = 0.7F,
                         .columns = 90,
                         .rows = 70,
                         .whole_from_z = 0.9F};

const Distortion kLenses[] = {
    {}, {-0.1, 0.02, 0.001, -0.002}, {-0.1, 0.02, 0.001, -0.002, 0.01, 0.02, 0.01, 0.01}};

CameraModel model_with(const Distortion& lens) {
  return shapes::camera({2, 0.3, 0.2}, {0, 0.1, 0}, kSize, 170, lens);
}

/// Some behind the camera, some nearer than whole_from_z, most in the image; no whole block.
std::vector<Eigen::Vector3f> random_positions() {
  std::mt19937 random(5);
  std::uniform_real_distribution<float> along(-2.5F, 2.5F);
  std::vector<Eigen::Vector3f> positions;
  for (size_t i = 0; i < 2 * PointArrays::kBlock + 77; ++i) {
    positions.emplace_back(along(random), along(random) / 2, along(random) / 2);
  }
  return positions;
}

/// Reference by the definition, one point at a time.
int32_t cell_of(const VoxelCamera& lens, const Eigen::Vector3f& position) {
  const auto p = camera_point<float>(lens, position.x(), position.y(), position.z());
  const PixelPoint<float> q = pixel_point(lens, p);
  const bool seen = p.z >= static_cast<float>(kNearPlaneMetres) && q.radius2 <= lens.max_radius2;
  if (!seen) return kGrid.count();
  if (p.z < kGrid.whole_from_z) return LocatedPoints::kNear;
  const float column = (q.u - kGrid.first_u) * kGrid.cells_per_pixel;
  const float row = (q.v - kGrid.first_v) * kGrid.cells_per_pixel;
  const bool in_cell = column >= 0 && row >= 0 && column < static_cast<float>(kGrid.columns) &&
                       row < static_cast<float>(kGrid.rows);
  return in_cell ? static_cast<int32_t>(row) * kGrid.columns + static_cast<int32_t>(column)
                 : kGrid.count();
}

TEST(LocatePoints, finds_the_cell_of_each_point_on_every_instruction_set) {
  const std::vector<Eigen::Vector3f> positions = random_positions();
  const PointArrays points(positions);
  for (const Distortion& distortion : kLenses) {
    const VoxelCamera lens = camera_of_metres(model_with(distortion));
    on_every_instruction_set([&] {
      int near = 0, inside = 0, nowhere = 0;
      for (size_t first = 0; first < points.x.size(); first += PointArrays::kBlock) {
        LocatedPoints located;
        locate_points(lens, kGrid, points, first, located);
        for (size_t i = 0; i < PointArrays::kBlock; ++i) {
          const bool exists = first + i < positions.size();
          const int32_t expected = exists ? cell_of(lens, positions[first + i]) : kGrid.count();
          ASSERT_EQ(located.cell[i], expected) << first + i;
          near += expected == LocatedPoints::kNear;
          nowhere += expected == kGrid.count();
          inside += expected >= 0 && expected < kGrid.count();
        }
      }
      EXPECT_GT(near, 20);
      EXPECT_GT(inside, 200);
      EXPECT_GT(nowhere, 200);
    });
  }
}

TEST(LocatePoints, returns_the_cell_and_the_depth_of_a_point) {
  const CameraModel model = model_with({});
  const Eigen::Vector3f position(0.1F, -0.2F, 0.15F);
  LocatedPoints located;
  locate_points(camera_of_metres(model), kGrid, PointArrays({position}), 0, located);
  const Eigen::Vector2d pixel = model.project(position.cast<double>()).value();
  EXPECT_NEAR(located.column[0], (pixel.x() + 0.5 - kGrid.first_u) * kGrid.cells_per_pixel, 0.02);
  EXPECT_NEAR(located.row[0], (pixel.y() + 0.5 - kGrid.first_v) * kGrid.cells_per_pixel, 0.02);
  EXPECT_NEAR(located.z[0], (model.cam_from_world() * position.cast<double>()).z(), 1e-5);
}

TEST(ProjectVertices,
     projects_by_the_whole_lens_model_with_the_same_bits_on_every_instruction_set) {
  Mesh mesh;
  mesh.vertices = random_positions();
  for (const Distortion& distortion : kLenses) {
    const CameraModel model = model_with(distortion);
    const std::vector<ScreenVertex> usual = project_vertices(mesh, model);
    int shown = 0;
    for (size_t v = 0; v < mesh.vertices.size(); ++v) {
      const Eigen::Vector3d position = mesh.vertices[v].cast<double>();
      const double z = (model.cam_from_world() * position).z();
      EXPECT_NEAR(usual[v].z, z, 1e-5);
      const auto expected = model.project(position);
      if (z < 0.2 || !expected) continue;
      ASSERT_TRUE(usual[v].on_screen());
      EXPECT_NEAR(usual[v].inverse_z, 1 / z, 1e-5);
      if (!model.inside_image(*expected)) continue;
      EXPECT_LT(std::hypot(usual[v].x - expected->x(), usual[v].y - expected->y()), 0.02);
      ++shown;
    }
    EXPECT_GT(shown, 100);
    on_every_instruction_set([&] {
      const std::vector<ScreenVertex> screen = project_vertices(mesh, model);
      for (size_t v = 0; v < screen.size(); ++v) {
        if (!usual[v].on_screen()) {
          EXPECT_FALSE(screen[v].on_screen());
          continue;
        }
        EXPECT_EQ(screen[v].x, usual[v].x);
        EXPECT_EQ(screen[v].y, usual[v].y);
      }
    });
  }
}

TEST(ProjectVertices, rejects_points_before_the_near_plane) {
  const CameraModel model = shapes::camera({0, 0, 1}, {1, 0, 1}, kSize, 170);
  Mesh mesh;
  mesh.vertices = {{0.049F, 0, 1}, {0.051F, 0, 1}, {-1, 0, 1}};
  const std::vector<ScreenVertex> screen = project_vertices(mesh, model);
  EXPECT_FALSE(screen[0].on_screen());
  EXPECT_TRUE(screen[1].on_screen());
  EXPECT_FALSE(screen[2].on_screen());
}

}  // namespace
}  // namespace v3d::recon
