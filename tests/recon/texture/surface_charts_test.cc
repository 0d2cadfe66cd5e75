#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

#include <Eigen/Geometry>
#include <cmath>
#include <map>
#include <utility>

#include "recon/mesh/mesh_neighbours.h"
#include "recon/render/rasteriser.h"
#include "recon/shapes.h"
#include "recon/texture/texture_atlas.h"

namespace v3d::recon {
namespace {

/// A ball with bumps of `height_m` metres, deep enough to hide parts of it from every direction.
Mesh bumpy_ball(float height_m, int waves) {
  Mesh ball = shapes::sphere({0, 0, 0}, 0.5F, 32);
  for (Eigen::Vector3f& p : ball.vertices) {
    const auto n = static_cast<float>(waves);
    p *= 1 + height_m / 0.5F * std::sin(n * p.x() * 6) * std::sin(n * p.y() * 6) *
                 std::cos(n * p.z() * 6);
  }
  return ball;
}

std::vector<int> charts_per_triangle(const Mesh& mesh, const std::vector<Chart>& charts) {
  std::vector<int> count(mesh.triangles.size(), 0);
  for (const Chart& chart : charts) {
    for (const uint32_t t : chart.triangles) ++count[t];
    for (const uint32_t t : chart.folded) ++count[t];
  }
  return count;
}

Eigen::Vector2f flat(const Mesh& mesh, const Chart& chart, uint32_t vertex) {
  return {mesh.vertices[vertex].dot(chart.right), mesh.vertices[vertex].dot(chart.up)};
}

RC_GTEST_PROP(SurfaceCharts, contain_every_triangle_once_and_turn_none_over,
              (int waves, int millimetres)) {
  const Mesh mesh =
      bumpy_ball(static_cast<float>(std::abs(millimetres % 150)) / 1000, 1 + std::abs(waves % 4));
  const std::vector<Chart> charts = surface_charts(mesh);
  for (const int count : charts_per_triangle(mesh, charts)) RC_ASSERT(count == 1);
  for (const Chart& chart : charts) {
    RC_ASSERT(std::abs(chart.right.dot(chart.up)) < 1e-5F);
    RC_ASSERT(std::abs(chart.right.norm() - 1) < 1e-5F);
    for (const uint32_t t : chart.triangles) {
      const auto& [a, b, c] = mesh.triangles[t];
      const Eigen::Vector2f p = flat(mesh, chart, a);
      const Eigen::Vector2f ab = flat(mesh, chart, b) - p, ac = flat(mesh, chart, c) - p;
      RC_ASSERT(ab.x() * ac.y() - ab.y() * ac.x() >= -1e-9F);
    }
  }
}

RC_GTEST_PROP(SurfaceCharts, show_every_place_of_their_plane_once, (int waves)) {
  const Mesh mesh = bumpy_ball(0.15F, 1 + std::abs(waves % 4));
  const auto cell_m = static_cast<float>(mean_edge(mesh) / 3);
  // Any lattice will do, since the chart that overlaps does so in many cells: at most a few cells
  // at the borders of triangles differ between lattices.
  int covered = 0, twice = 0;
  for (const Chart& chart : surface_charts(mesh)) {
    std::map<std::pair<int, int>, int> cells;
    for (const uint32_t t : chart.triangles) {
      std::array<ScreenVertex, 3> corner;
      for (size_t k = 0; k < 3; ++k) {
        const Eigen::Vector2f p = flat(mesh, chart, mesh.triangles[t][k]) / cell_m;
        corner[k].x = p.x() + 1000;
        corner[k].y = p.y() + 1000;
      }
      for_each_span(corner, {2000, 0, 2000}, [&](int y, int begin, int end) {
        for (int x = begin; x < end; ++x) ++cells[{x, y}];
      });
    }
    for (const auto& [cell, count] : cells) {
      ++covered;
      twice += count > 1;
    }
  }
  RC_ASSERT(covered > 1000);
  RC_ASSERT(twice < covered / 200);
}

TEST(SurfaceCharts, are_large_on_a_smooth_surface) {
  const Mesh ball = shapes::sphere({0, 0, 0}, 0.5F, 48);
  const size_t charts = surface_charts(ball).size();
  EXPECT_GE(charts, 6U);
  EXPECT_LE(charts, 14U) << "one for each direction";
}

TEST(SurfaceCharts, contain_triangles_without_area) {
  Mesh mesh;
  mesh.vertices = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {2, 0, 0}};
  mesh.triangles = {{0, 1, 2}, {0, 1, 3}, {3, 3, 3}};
  for (const int count : charts_per_triangle(mesh, surface_charts(mesh))) EXPECT_EQ(count, 1);
  for (const Chart& chart : surface_charts(mesh)) EXPECT_TRUE(chart.right.allFinite());
}

TEST(SurfaceCharts, keep_a_small_fold_inside) {
  Mesh mesh = shapes::patch(0.5F, 0, 20);
  // One vertex in the middle moves beyond its neighbours, so that the triangles behind it turn
  // over.
  mesh.vertices[10 * 21 + 10] += Eigen::Vector3f(0.08F, 0.01F, 0.01F);
  const std::vector<Chart> charts = surface_charts(mesh);
  ASSERT_EQ(charts.size(), 1U);
  EXPECT_GT(charts[0].folded.size(), 0U);
  EXPECT_EQ(charts[0].folded.size() + charts[0].triangles.size(), mesh.triangles.size());
}

TEST(SurfaceCharts, have_coarser_cells_where_a_triangle_would_have_more_than_memory_holds) {
  // The last triangle has 5 * 10^11 cells of the requested size.
  Mesh mesh = shapes::sphere({0, 0, 0}, 0.5F, 16);
  const auto first = static_cast<uint32_t>(mesh.vertices.size());
  mesh.vertices.insert(mesh.vertices.end(), {{0, 0, 5}, {100, 0, 5}, {0, 100, 5}});
  mesh.triangles.push_back({first, first + 1, first + 2});
  for (const int count : charts_per_triangle(mesh, surface_charts(mesh, 1e-4))) {
    EXPECT_EQ(count, 1);
  }
}

TEST(SurfaceCharts, of_an_empty_mesh_are_none) { EXPECT_TRUE(surface_charts({}).empty()); }

}  // namespace
}  // namespace v3d::recon
