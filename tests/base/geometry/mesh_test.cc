#include "base/geometry/mesh.h"

#include <gtest/gtest.h>

namespace v3d {
namespace {

/// A unit cube with its lowest corner at `corner`; outward triangles.
Mesh cube(const Eigen::Vector3f& corner) {
  Mesh mesh;
  for (int i = 0; i < 8; ++i) {
    mesh.vertices.push_back(corner + Eigen::Vector3f(i & 1, (i >> 1) & 1, i >> 2));
  }
  constexpr uint32_t kQuads[6][4] = {{0, 2, 3, 1}, {4, 5, 7, 6}, {0, 1, 5, 4},
                                     {2, 6, 7, 3}, {0, 4, 6, 2}, {1, 3, 7, 5}};
  for (const auto& q : kQuads) {
    mesh.triangles.push_back({q[0], q[1], q[2]});
    mesh.triangles.push_back({q[0], q[2], q[3]});
  }
  return mesh;
}

void append(Mesh& mesh, const Mesh& other) {
  const auto base = static_cast<uint32_t>(mesh.vertices.size());
  mesh.vertices.insert(mesh.vertices.end(), other.vertices.begin(), other.vertices.end());
  for (const auto& t : other.triangles) {
    mesh.triangles.push_back({t[0] + base, t[1] + base, t[2] + base});
  }
}

TEST(Mesh, enclosed_volume_does_not_depend_on_the_position) {
  EXPECT_NEAR(enclosed_volume(cube({0, 0, 0})), 1, 1e-6);
  EXPECT_NEAR(enclosed_volume(cube({5, -3, 2})), 1, 1e-4);
}

TEST(Mesh, normals_of_a_cube_point_outward) {
  const Mesh mesh = cube({0, 0, 0});
  const auto normals = vertex_normals(mesh);
  for (size_t i = 0; i < normals.size(); ++i) {
    EXPECT_NEAR(normals[i].norm(), 1, 1e-6);
    EXPECT_GT(normals[i].dot(mesh.vertices[i] - Eigen::Vector3f(0.5, 0.5, 0.5)), 0);
  }
}

TEST(Mesh, is_not_watertight_with_a_missing_or_flipped_triangle) {
  Mesh mesh = cube({0, 0, 0});
  EXPECT_TRUE(is_watertight(mesh));
  EXPECT_TRUE(is_manifold(mesh));
  Mesh with_hole = mesh;
  with_hole.triangles.pop_back();
  EXPECT_FALSE(is_watertight(with_hole));
  std::swap(mesh.triangles[0][0], mesh.triangles[0][1]);
  EXPECT_FALSE(is_watertight(mesh));
}

TEST(Mesh, of_two_cubes_with_a_shared_vertex_is_watertight_but_not_manifold) {
  Mesh mesh = cube({0, 0, 0});
  append(mesh, cube({1, 1, 1}));
  EXPECT_TRUE(is_manifold(mesh));
  EXPECT_EQ(connected_components(mesh), 2);
  // Corner 7 of the first cube and corner 0 of the second (vertex 8) coincide: merge them.
  for (auto& t : mesh.triangles) {
    for (uint32_t& v : t) {
      v = v == 8 ? 7 : v;
    }
  }
  EXPECT_TRUE(is_watertight(mesh));
  EXPECT_FALSE(is_manifold(mesh));
  EXPECT_EQ(connected_components(mesh), 1);
}

TEST(Mesh, keeps_the_triangles_of_its_largest_component) {
  Mesh mesh = cube({0, 0, 0});
  mesh.triangles.pop_back();
  const size_t smaller = mesh.triangles.size();
  append(mesh, cube({3, 0, 0}));
  const Mesh largest = largest_component(mesh);
  EXPECT_EQ(largest.vertices.size(), mesh.vertices.size());
  EXPECT_TRUE(std::equal(largest.triangles.begin(), largest.triangles.end(),
                         mesh.triangles.begin() + static_cast<std::ptrdiff_t>(smaller),
                         mesh.triangles.end()));
  EXPECT_TRUE(largest_component({}).triangles.empty());
}

TEST(Mesh, does_not_count_unused_vertices_as_components) {
  Mesh mesh = cube({0, 0, 0});
  mesh.vertices.emplace_back(9, 9, 9);
  EXPECT_EQ(connected_components(mesh), 1);
}

}  // namespace
}  // namespace v3d
