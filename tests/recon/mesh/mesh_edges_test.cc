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

TEST(MeshEdges, have_a_mean_length) {
  Mesh mesh;
  mesh.vertices = {{0, 0, 0}, {3, 0, 0}, {0, 1, 0}, {0, 0, 5}};
  EXPECT_EQ(mean_edge(mesh), 0);
  mesh.triangles = {{0, 1, 2}, {2, 0, 3}};
  EXPECT_DOUBLE_EQ(mean_edge(mesh), 2);
}

}  // namespace
}  // namespace v3d::recon
