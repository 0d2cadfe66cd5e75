#include <gtest/gtest.h>

#include <algorithm>
#include <set>

#include "recon/mesh/mesh_neighbours.h"
#include "recon/shapes.h"

namespace v3d::recon {
namespace {

/// Reference: neighbours by vertex, from the edges of all triangles.
std::vector<std::set<uint32_t>> joined_vertices(const Mesh& mesh) {
  std::vector<std::set<uint32_t>> joined(mesh.vertices.size());
  for (const auto& t : mesh.triangles) {
    for (int k = 0; k < 3; ++k) {
      joined[t[k]].insert(t[(k + 1) % 3]);
      joined[t[(k + 1) % 3]].insert(t[k]);
    }
  }
  return joined;
}

Mesh ball_and_box() {
  Mesh mesh = shapes::sphere({0, 0, 0}, 1, 9);
  shapes::append(mesh, shapes::box({2, 2, 2}, {3, 3, 3}));
  return mesh;
}

TEST(Neighbours, of_a_vertex_are_listed_once) {
  const Mesh mesh = ball_and_box();
  const Neighbours neighbours(mesh);
  const auto expected = joined_vertices(mesh);
  ASSERT_EQ(neighbours.size(), mesh.vertices.size());
  for (size_t v = 0; v < mesh.vertices.size(); ++v) {
    const auto around = neighbours.of(v);
    EXPECT_EQ(std::set<uint32_t>(around.begin(), around.end()), expected[v]) << v;
    EXPECT_EQ(around.size(), expected[v].size()) << v;
  }
}

TEST(Neighbours, are_none_without_a_mesh_or_triangle) {
  EXPECT_EQ(Neighbours().size(), 0U);
  EXPECT_EQ(Neighbours(Mesh{}).size(), 0U);
  Mesh lonely;
  lonely.vertices.emplace_back(1, 2, 3);
  EXPECT_TRUE(Neighbours(lonely).of(0).empty());
}

TEST(NeighbourRows, contain_the_kth_neighbour_of_sixteen_vertices_side_by_side) {
  const Mesh mesh = ball_and_box();
  const Neighbours neighbours(mesh);
  const NeighbourRows rows(neighbours);
  constexpr size_t kWidth = NeighbourRows::kWidth;
  ASSERT_NE(mesh.vertices.size() % kWidth, 0U) << "the last group is to be filled up";
  ASSERT_EQ(rows.groups(), mesh.vertices.size() / kWidth + 1);
  EXPECT_EQ(rows.vertices(), rows.groups() * kWidth);
  for (size_t v = 0; v < rows.vertices(); ++v) {
    const auto around = v < neighbours.size() ? neighbours.of(v) : std::span<const uint32_t>();
    const auto group = rows.rows(v / kWidth);
    EXPECT_EQ(rows.counts(v / kWidth).of[v % kWidth], static_cast<float>(around.size()));
    ASSERT_GE(group.size(), around.size());
    for (size_t k = 0; k < group.size(); ++k) {
      const size_t expected = k < around.size() ? around[k] : rows.vertices();
      EXPECT_EQ(group[k].vertex[v % kWidth], static_cast<int32_t>(expected)) << v << " row " << k;
    }
  }
}

TEST(NeighbourRows, are_as_many_as_the_largest_number_of_neighbours_in_a_group) {
  const Neighbours neighbours(ball_and_box());
  const NeighbourRows rows(neighbours);
  for (size_t group = 0; group < rows.groups(); ++group) {
    size_t most = 0;
    for (size_t v = 16 * group; v < std::min(neighbours.size(), 16 * group + 16); ++v) {
      most = std::max(most, neighbours.of(v).size());
    }
    EXPECT_EQ(rows.rows(group).size(), most);
  }
}

}  // namespace
}  // namespace v3d::recon
