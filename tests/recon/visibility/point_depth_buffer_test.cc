#include "recon/visibility/point_depth_buffer.h"

#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

#include <algorithm>
#include <cmath>
#include <random>

#include "recon/hull/sparse_volume.h"
#include "recon/shapes.h"
#include "recon/visibility/depth_buffer.h"
#include "recon/volumes.h"
#include "support/instruction_sets.h"

namespace v3d::recon {
namespace {

using shapes::camera;

VoxelCamera in_metres(const CameraModel& model) {
  return {model, {Eigen::Vector3d::Constant(-0.5), 1, {}}};
}

PointDepthBuffer cells_of(const Mesh& mesh, double radius_m, const CameraModel& model, Rect roi,
                          const Eigen::Vector3f& centroid) {
  return {PointArrays(occluding_points(mesh, radius_m)),
          centroid,
          radius_m,
          model,
          in_metres(model),
          roi};
}

/// Depth of the cell that contains the centre of a pixel.
float nearest_at(const PointDepthBuffer& cells, int x, int y) {
  const CellGrid& grid = cells.grid();
  const auto column = static_cast<int>((x + 0.5F - grid.first_u) * grid.cells_per_pixel);
  const auto row = static_cast<int>((y + 0.5F - grid.first_v) * grid.cells_per_pixel);
  return cells.nearest()[row * grid.columns + column];
}

RC_GTEST_PROP(OccludingPoints, leave_no_place_on_a_triangle_far_from_a_point, ()) {
  std::mt19937 random(*rc::gen::arbitrary<uint32_t>());
  std::uniform_real_distribution<float> coordinate(-1, 1), part(0, 1);
  Mesh mesh;
  for (int i = 0; i < 3; ++i) {
    mesh.vertices.emplace_back(coordinate(random), coordinate(random), coordinate(random));
  }
  mesh.triangles = {{0, 1, 2}};
  const double radius = *rc::gen::inRange(5, 200) / 100.0;
  const auto points = occluding_points(mesh, radius);
  for (int i = 0; i < 200; ++i) {
    float a = part(random), b = part(random);
    if (a + b > 1) {
      a = 1 - a, b = 1 - b;
    }
    const Eigen::Vector3f p = mesh.vertices[0] + a * (mesh.vertices[1] - mesh.vertices[0]) +
                              b * (mesh.vertices[2] - mesh.vertices[0]);
    const bool covered = std::any_of(points.begin(), points.end(), [&](const auto& q) {
      return (p - q).norm() <= radius * 1.0001;
    });
    RC_ASSERT(covered);
  }
}

TEST(OccludingPoints, of_a_volume_are_its_vertices) {
  std::mt19937 random(3);
  const SparseVolume volume =
      make_volume(small_grid(20, 20, 20), [&](int, int, int) { return random() % 2 == 0; });
  const Mesh mesh = marching_cubes(volume);
  ASSERT_GT(mesh.vertices.size(), 1000);
  EXPECT_EQ(occluding_points(mesh, 0.0071).size(), mesh.vertices.size());
  EXPECT_GT(occluding_points(mesh, 0.0070).size(), mesh.vertices.size());
}

/// Triangles of 1 m.
Mesh large_triangles(size_t count) {
  Mesh mesh{.vertices = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}}, .triangles = {}, .colours = {}};
  mesh.triangles.assign(count, {0, 1, 2});
  return mesh;
}

TEST(OccludingPoints, are_few_for_a_triangle_that_is_far_larger_than_the_radius) {
  constexpr size_t kMax = 1025 * 1026 / 2;  // the corners of 1024 * 1024 similar triangles
  for (const double radius : {1e-4, 1e-30, 0.0}) {
    EXPECT_EQ(occluding_points(large_triangles(1), radius).size(), kMax) << radius;
  }
}

TEST(OccludingPoints, are_not_added_to_further_triangles_beyond_their_limit) {
  const size_t of_one = occluding_points(large_triangles(1), 0.01).size();
  ASSERT_GT(of_one, 1000U);
  EXPECT_EQ(occluding_points(large_triangles(50), 0.01, 100).size(), of_one);
}

/// A ball of large triangles, a smaller one before it, and a plate that nearly touches the camera.
Mesh crowded_scene() {
  Mesh mesh = shapes::sphere({0, 0, 0}, 0.6F, 9);
  shapes::append(mesh, shapes::sphere({0.3F, -1.0F, 0.2F}, 0.15F, 6));
  Mesh plate = shapes::patch(0.03F, 0, 2);
  for (Eigen::Vector3f& v : plate.vertices) {
    v = Eigen::Vector3f(v.x() - 0.2F, -2.2F, v.y() - 0.1F);
  }
  shapes::append(mesh, plate);
  return mesh;
}

TEST(PointDepthBuffer, have_no_hole_where_triangles_cover_the_image) {
  const Mesh mesh = crowded_scene();
  for (const Distortion& lens : {Distortion{}, Distortion{-0.2, 0.05, 0.001, -0.002}}) {
    const CameraModel eye = camera({0, -3, 0}, {0, 0, 0}, {320, 240}, 260, lens);
    const Rect roi{40, 30, 250, 180};
    const DepthBuffer truth = draw_depth(mesh, eye);
    for (const double radius : {0.004, 0.02, 0.1}) {
      const PointDepthBuffer cells = cells_of(mesh, radius, eye, roi, {0, 0, 0});
      int covered = 0;
      for (int y = roi.y0; y < roi.y0 + roi.height; ++y) {
        for (int x = roi.x0; x < roi.x0 + roi.width; ++x) {
          if (std::isfinite(truth.at(x, y))) {
            // A point within the radius may lie as much deeper.
            ASSERT_LE(nearest_at(cells, x, y), truth.at(x, y) + radius + 1e-3) << x << " " << y;
            ++covered;
          }
        }
      }
      EXPECT_GT(covered, 8000);
    }
  }
}

TEST(PointDepthBuffer, have_no_hole_at_the_maximum_distance_of_points) {
  // Squares of 5 cm, turned by 45 degrees: their centres have the maximum distance from a point,
  // straight beside it.
  Mesh plane = shapes::patch(0.5F, 0, 20);
  for (Eigen::Vector3f& v : plane.vertices) {
    v = Eigen::Vector3f(v.x() + v.y(), v.y() - v.x(), 0) / std::sqrt(2.0F);
  }
  const CameraModel above = camera({0, 0, 3}, {0, 0, 0}, {320, 240}, 600);
  const Rect roi{100, 60, 120, 120};
  // A centroid behind the plane: the cells fit a distance nearer than it, just that of the plane.
  const PointDepthBuffer cells = cells_of(plane, 0.0354, above, roi, {0, 0, -0.75F});
  ASSERT_GT(cells.grid().cell_width(), 3);
  for (int y = roi.y0; y < roi.y0 + roi.height; ++y) {
    for (int x = roi.x0; x < roi.x0 + roi.width; ++x) {
      ASSERT_NEAR(nearest_at(cells, x, y), 3, 1e-4) << x << " " << y;
    }
  }
}

TEST(PointDepthBuffer, are_empty_a_few_cells_beside_the_surface) {
  const Mesh ball = shapes::sphere({0, 0, 0}, 0.5F, 60);
  const CameraModel eye = camera({0, -3, 0}, {0, 0, 0}, {320, 240}, 260);
  const PointDepthBuffer cells = cells_of(ball, 0.02, eye, {0, 0, 320, 240}, {0, 0, 0});
  const double edge = 260 * std::tan(std::asin(0.5 / 3));
  const double reach = 3 * std::sqrt(2.0) * cells.grid().cell_width() + 1;
  for (int y = 0; y < 240; ++y) {
    for (int x = 0; x < 320; ++x) {
      if (std::hypot(x - 159.5, y - 119.5) > edge + reach) {
        ASSERT_TRUE(std::isinf(nearest_at(cells, x, y))) << x << " " << y;
      }
    }
  }
}

TEST(PointDepthBuffer, are_the_same_on_every_instruction_set) {
  const Mesh mesh = crowded_scene();
  for (const Distortion& lens : {Distortion{}, Distortion{-0.2, 0.05, 0.001, -0.002},
                                 Distortion{-0.2, 0.05, 0.001, -0.002, 0.01, 0.02, 0, 0, 0.003}}) {
    const CameraModel eye = camera({0, -3, 0}, {0, 0, 0}, {320, 240}, 260, lens);
    const auto draw = [&] {
      const PointDepthBuffer cells = cells_of(mesh, 0.02, eye, {40, 30, 250, 180}, {0, 0, 0});
      return std::vector<float>(cells.nearest(), cells.nearest() + cells.grid().count());
    };
    const std::vector<float> best = draw();
    on_every_instruction_set([&] {
      const std::vector<float> found = draw();
      EXPECT_EQ(found, best);
    });
  }
}

}  // namespace
}  // namespace v3d::recon
