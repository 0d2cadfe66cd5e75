#include "recon/skeleton/geodesic_integral.h"

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <numbers>
#include <numeric>
#include <vector>

#include "recon/figures.h"
#include "recon/shapes.h"

namespace v3d::recon {
namespace {

using Eigen::Vector3d;

/// A bar of 1 m along x.
Mesh bar() {
  return figures::surface({figures::Capsule{Vector3d(-0.45, 0, 0), Vector3d(0.45, 0, 0), 0.05}});
}

GeodesicIntegral integral_of(const Mesh& mesh) {
  return geodesic_integral(mesh, VertexGraph(mesh));
}

TEST(VertexGraph, has_each_edge_of_a_mesh_in_both_directions) {
  const Mesh box = shapes::box({0, 0, 0}, {1, 1, 1});
  const VertexGraph graph(box);
  ASSERT_EQ(graph.size(), box.vertices.size());
  size_t links = 0;
  for (uint32_t v = 0; v < graph.size(); ++v) {
    for (const VertexGraph::Link& link : graph.of(v)) {
      ++links;
      EXPECT_EQ(link.metres, (box.vertices[v] - box.vertices[link.to]).norm());
      EXPECT_TRUE(std::ranges::any_of(graph.of(link.to),
                                      [&](const VertexGraph::Link& back) { return back.to == v; }));
    }
  }
  EXPECT_EQ(links, 2 * 18U) << "12 edges of a box and a diagonal in each of 6 faces";
}

TEST(ShortestPaths, choose_the_shorter_way_and_end_at_the_limit) {
  const VertexGraph graph(4, {{0, 1, 1}, {1, 2, 1}, {0, 2, 5}, {2, 3, 10}});
  std::vector<float> metres(4, ShortestPaths::kUnreached);
  metres[0] = 0;
  const std::vector<uint32_t> sources = {0};
  ShortestPaths().run(graph, sources, 6, metres, [](uint32_t, uint32_t) {});
  EXPECT_EQ(metres, (std::vector<float>{0, 1, 2, ShortestPaths::kUnreached}));
}

TEST(VertexAreas, sum_up_to_the_surface) {
  const std::vector<double> areas = vertex_areas(shapes::box({0, 0, 0}, {1, 2, 3}));
  EXPECT_NEAR(std::accumulate(areas.begin(), areas.end(), 0.0), 22, 1e-5);
}

TEST(GeodesicIntegral, is_least_in_the_middle_of_a_bar_and_greatest_at_its_ends) {
  const Mesh mesh = bar();
  const GeodesicIntegral integral = integral_of(mesh);
  EXPECT_EQ(integral.components, 1U);
  for (size_t v = 0; v < mesh.vertices.size(); ++v) {
    const float x = std::abs(mesh.vertices[v].x());
    if (x < 0.02F) {
      EXPECT_LT(integral.normalised[v], 0.1F);
    }
    // The mean distance from an end of a thin bar is twice that from its middle.
    if (x > 0.48F) {
      EXPECT_GT(integral.normalised[v], 0.35F);
    }
    EXPECT_GE(integral.normalised[v], 0);
    EXPECT_LT(integral.normalised[v], 1);
  }
}

TEST(GeodesicIntegral, separates_components_and_vertices_without_a_triangle) {
  Mesh mesh = shapes::sphere({0, 0, 0}, 0.2F, 16);
  const size_t first = mesh.vertices.size();
  const Mesh other = shapes::sphere({1, 0, 0}, 0.2F, 16);
  for (const auto& vertex : other.vertices) mesh.vertices.push_back(vertex);
  for (const auto& [a, b, c] : other.triangles) {
    const auto offset = static_cast<uint32_t>(first);
    mesh.triangles.push_back({a + offset, b + offset, c + offset});
  }
  mesh.vertices.emplace_back(9, 9, 9);
  const GeodesicIntegral integral = integral_of(mesh);
  EXPECT_EQ(integral.components, 2U);
  EXPECT_NE(integral.component.front(), integral.component[first]);
  EXPECT_EQ(integral.component.back(), GeodesicIntegral::kNoComponent);
}

TEST(GeodesicIntegral, of_a_sphere_is_about_a_quarter_of_its_circumference) {
  constexpr float kRadius = 0.5F;
  constexpr float kQuarter = std::numbers::pi_v<float> / 2 * kRadius;
  const GeodesicIntegral integral = integral_of(shapes::sphere({0, 0, 0}, kRadius, 24));
  for (const float metres : integral.metres) {
    EXPECT_NEAR(metres, kQuarter, 0.12F * kQuarter);
  }
}

}  // namespace
}  // namespace v3d::recon
