#include <gtest/gtest.h>

#include "recon/mesh/mesh_neighbours.h"
#include "recon/shapes.h"

namespace v3d::recon {
namespace {

double longest_edge(const Mesh& mesh) {
  float longest = 0;
  for (const auto& t : mesh.triangles) {
    for (int k = 0; k < 3; ++k) {
      longest = std::max(longest, (mesh.vertices[t[k]] - mesh.vertices[t[(k + 1) % 3]]).norm());
    }
  }
  return longest;
}

TEST(MeshEdges, that_are_long_are_halved_without_a_change_of_the_surface) {
  // Triangles of many sizes, so that one, two and three of their edges are halved.
  Mesh mesh = shapes::sphere({0.1F, 0.2F, 0.3F}, 0.5F, 12);
  for (Eigen::Vector3f& vertex : mesh.vertices) vertex.z() *= 1 + 4 * std::abs(vertex.x());
  const double volume = enclosed_volume(mesh);
  for (const double most : {0.3, 0.1, 0.04}) {
    const Mesh fine = with_short_edges(mesh, most);
    EXPECT_LE(longest_edge(fine), most);
    EXPECT_TRUE(is_manifold(fine));
    EXPECT_NEAR(enclosed_volume(fine), volume, 1e-5);
    ASSERT_GT(fine.vertices.size(), mesh.vertices.size());
    EXPECT_TRUE(std::equal(mesh.vertices.begin(), mesh.vertices.end(), fine.vertices.begin()));
  }
}

TEST(MeshEdges, that_are_short_enough_are_unchanged) {
  const Mesh mesh = shapes::sphere({0, 0, 0}, 0.5F, 12);
  const Mesh same = with_short_edges(mesh, 10);
  EXPECT_EQ(same.triangles, mesh.triangles);
  EXPECT_EQ(same.vertices.size(), mesh.vertices.size());
}

TEST(MeshEdges, that_single_precision_cannot_halve_stay) {
  // Coordinates at 500 km have steps of 1/32 m.
  constexpr float kFar = 500'000, kStep = 1.0F / 32;
  Mesh mesh;
  mesh.vertices = {{kFar, 0, 0}, {kFar + kStep, 0, 0}, {kFar, 0, 4 * kStep}};
  mesh.triangles = {{0, 1, 2}};
  const Mesh fine = with_short_edges(mesh, 0.02);
  EXPECT_GT(fine.triangles.size(), 4U);
  EXPECT_GE(longest_edge(fine), kStep);
  EXPECT_LE(longest_edge(fine), 2 * kStep);
}

TEST(MeshEdges, have_a_known_number_before_they_are_halved) {
  Mesh mesh;
  mesh.vertices = {{0, 0, 0}, {0.8F, 0, 0}, {0, 0.8F, 0}, {0, 0.01F, 0}};
  mesh.triangles = {{0, 1, 2}};
  const auto added = [&](double max_m) {
    return static_cast<double>(with_short_edges(mesh, max_m).triangles.size() - 1);
  };
  EXPECT_EQ(added_triangles(mesh, 2), 0);
  EXPECT_LT(added(0.05), 4 * added_triangles(mesh, 0.05));
  EXPECT_LT(added_triangles(mesh, 0.05), 4 * added(0.05));
  mesh.triangles = {{0, 1, 3}};
  EXPECT_LT(added_triangles(mesh, 0.05), 20) << "a thin triangle";
}

TEST(MeshEdges, have_a_mean_length) {
  Mesh mesh;
  mesh.vertices = {{0, 0, 0}, {3, 0, 0}, {0, 1, 0}, {0, 0, 5}};
  EXPECT_EQ(mean_edge(mesh), 0);
  mesh.triangles = {{0, 1, 2}, {2, 0, 3}};
  EXPECT_DOUBLE_EQ(mean_edge(mesh), 2);
}

}  // namespace
}  // namespace v3d::recon
