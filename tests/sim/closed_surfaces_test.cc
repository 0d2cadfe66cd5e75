#include <gtest/gtest.h>

#include "base/geometry/mesh.h"
#include "sim/performer/skinned_model.h"

namespace v3d::sim {
namespace {

using Eigen::Vector3f;

/// The corners of a tetrahedron, then the first one again.
const std::vector<Vector3f> kCorners = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {0, 0, 1}, {0, 0, 0}};
const std::vector<std::array<uint32_t, 3>> kTriangles = {
    {0, 2, 1}, {4, 1, 3}, {1, 2, 3}, {0, 3, 2}};

Mesh mesh_of(const ClosedSurface& surface, const std::vector<Vector3f>& positions) {
  Mesh mesh;
  for (const uint32_t v : surface.sources) mesh.vertices.push_back(positions[v]);
  surface.add_middles(mesh.vertices);
  mesh.triangles = surface.triangles;
  return mesh;
}

TEST(ClosedSurfaces, weld_vertices_at_equal_positions) {
  const auto surfaces = closed_surfaces(kCorners, kTriangles);
  ASSERT_EQ(surfaces.size(), 1U);
  EXPECT_EQ(surfaces[0].sources.size(), 4U);
  EXPECT_TRUE(surfaces[0].holes.empty());
  EXPECT_TRUE(is_manifold(mesh_of(surfaces[0], kCorners)));
}

TEST(ClosedSurfaces, have_triangles_in_their_holes_that_face_outward) {
  auto open = kTriangles;
  open.erase(open.begin() + 2);
  const auto surfaces = closed_surfaces(kCorners, open);
  ASSERT_EQ(surfaces[0].holes.size(), 1U);
  const Mesh mesh = mesh_of(surfaces[0], kCorners);
  EXPECT_TRUE(is_manifold(mesh));
  EXPECT_NEAR(enclosed_volume(mesh), 1.0 / 6, 1e-6);
  EXPECT_LT((mesh.vertices.back() - Vector3f::Constant(1.0F / 3)).norm(), 1e-6F);
}

TEST(ClosedSurfaces, are_watertight_where_two_holes_share_a_vertex) {
  // A fan of four triangles around a vertex, without two of them that are opposite: one ring.
  const std::vector<Vector3f> corners = {{0, 0, 1}, {1, 0, 0}, {0, 1, 0}, {-1, 0, 0}, {0, -1, 0}};
  const std::vector<std::array<uint32_t, 3>> triangles = {
      {0, 1, 2}, {0, 3, 4}, {1, 3, 2}, {1, 4, 3}};
  const auto surfaces = closed_surfaces(corners, triangles);
  ASSERT_EQ(surfaces.size(), 1U);
  EXPECT_EQ(surfaces[0].holes.size(), 2U);
  EXPECT_TRUE(is_watertight(mesh_of(surfaces[0], corners)));
}

TEST(ClosedSurfaces, are_as_many_as_the_triangles_have_connected_components) {
  std::vector<Vector3f> corners = kCorners;
  auto triangles = kTriangles;
  for (const Vector3f& corner : kCorners) corners.emplace_back(corner + Vector3f(5, 0, 0));
  for (const auto& [a, b, c] : kTriangles) triangles.push_back({a + 5, b + 5, c + 5});
  triangles.push_back({0, 4, 1});  // has a vertex twice
  EXPECT_EQ(closed_surfaces(corners, triangles).size(), 2U);
}

}  // namespace
}  // namespace v3d::sim
