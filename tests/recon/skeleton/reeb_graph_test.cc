#include "recon/skeleton/reeb_graph.h"

#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <map>
#include <numeric>
#include <random>

#include "recon/figures.h"
#include "recon/shapes.h"

namespace v3d::recon {
namespace {

using Eigen::Vector3f;

std::map<uint32_t, double> area_of_intervals(const ReebLevel& level) {
  std::map<uint32_t, double> area;
  for (const ReebNode& node : level.nodes) area[node.interval] += node.area;
  return area;
}

double difference(const ReebLevel& a, const ReebLevel& b) {
  std::map<uint32_t, double> areas = area_of_intervals(a);
  for (const auto& [interval, area] : area_of_intervals(b)) areas[interval] -= area;
  double sum = 0;
  for (const auto& [interval, area] : areas) sum += std::abs(area);
  return sum / 2;
}

TEST(ReebGraph, has_five_ends_for_a_person_with_free_arms) {
  const ReebGraph graph = reeb_graph(figures::surface(figures::person(60, 45)));
  EXPECT_EQ(graph_branches(graph, 0.12).size(), 5U);
  EXPECT_EQ(graph.levels[0].nodes.size(), 1U);
}

TEST(ReebGraph, has_a_loop_where_a_hand_touches_the_body) {
  const auto loops = [](const Mesh& mesh) {
    const ReebGraph graph = reeb_graph(mesh);
    return graph.levels[5].edges.size() + 1 - graph.levels[5].nodes.size();
  };
  std::vector<figures::Capsule> body = figures::person(60, 60);
  const size_t free = loops(figures::surface(body));
  body.push_back({{0, 0.73, 1.08}, {0, 0.1, 0.93}, 0.04});  // from the left hand to the hip
  EXPECT_GT(loops(figures::surface(body)), free);
}

TEST(ReebGraph, has_one_node_for_each_component_at_the_coarsest_level) {
  Mesh mesh = shapes::sphere({0, 0, 0}, 0.3F, 16);
  shapes::append(mesh, shapes::sphere({2, 0, 0}, 0.1F, 12));
  const ReebGraph graph = reeb_graph(mesh);
  ASSERT_EQ(graph.levels[0].nodes.size(), 2U);
  EXPECT_NE(graph.levels[0].nodes[0].component, graph.levels[0].nodes[1].component);
  EXPECT_NEAR(graph.levels[0].nodes[0].area, 0.9, 0.02);
  EXPECT_NEAR(graph.levels[0].nodes[0].volume, 27.0 / 28, 0.02);
}

TEST(ReebGraph, has_no_nodes_for_a_mesh_without_area) {
  EXPECT_TRUE(reeb_graph({}).empty());
  Mesh line;
  line.vertices = {{0, 0, 0}, {1, 0, 0}, {2, 0, 0}};
  line.triangles = {{0, 1, 2}};
  EXPECT_TRUE(reeb_graph(line).empty());
}

TEST(ReebGraph, accepts_holes_and_edges_of_three_triangles_and_unused_vertices) {
  Mesh mesh = shapes::sphere({0, 0, 0}, 0.5F, 16);
  mesh.triangles.erase(mesh.triangles.begin() + 100, mesh.triangles.begin() + 140);
  const auto triangle = mesh.triangles[10];
  mesh.vertices.emplace_back(1, 1, 1);
  const auto outside = static_cast<uint32_t>(mesh.vertices.size() - 1);
  mesh.triangles.push_back({triangle[0], triangle[1], outside});
  mesh.triangles.push_back({triangle[0], triangle[0], triangle[1]});
  mesh.vertices.emplace_back(5, 5, 5);
  const ReebGraph graph = reeb_graph(mesh);
  EXPECT_EQ(graph.levels[0].nodes.size(), 1U);
  EXPECT_EQ(graph.node_of.back(), ReebNode::kNoParent);
  EXPECT_NE(graph.node_of[outside], ReebNode::kNoParent);
}

TEST(ReebGraph, has_an_edge_between_levels_for_each_node) {
  const ReebGraph graph = reeb_graph(figures::surface(figures::person(30, 80)));
  for (size_t level = 1; level < graph.levels.size(); ++level) {
    for (const ReebNode& node : graph.levels[level].nodes) {
      ASSERT_LT(node.parent, graph.levels[level - 1].nodes.size());
      EXPECT_EQ(graph.levels[level - 1].nodes[node.parent].interval, node.interval / 2);
    }
  }
}

std::vector<figures::Capsule> any_body() {
  const int left = *rc::gen::inRange(10, 120), right = *rc::gen::inRange(10, 120);
  return figures::person(left, right);
}

RC_GTEST_PROP(ReebGraph, has_shares_that_sum_to_one_at_every_level, ()) {
  Mesh mesh = figures::surface(any_body(), 0.04);
  if (*rc::gen::arbitrary<bool>()) shapes::append(mesh, shapes::sphere({1.5F, 0, 0}, 0.1F, 6));
  mesh.triangles.resize(mesh.triangles.size() -
                        static_cast<size_t>(*rc::gen::inRange(0, 50)));  // a hole
  for (const ReebLevel& level : reeb_graph(mesh).levels) {
    double area = 0, volume = 0;
    for (const ReebNode& node : level.nodes) {
      area += node.area;
      volume += node.volume;
    }
    RC_ASSERT(std::abs(area - 1) < 1e-9);
    RC_ASSERT(std::abs(volume - 1) < 1e-9);
  }
}

RC_GTEST_PROP(ReebGraph, is_the_same_after_a_rigid_motion, ()) {
  const Mesh mesh = figures::surface(any_body(), 0.04);
  const auto number = [] { return static_cast<float>(*rc::gen::inRange(-1000, 1000)) / 300; };
  const Eigen::Quaternionf turn = Eigen::AngleAxisf(number(), Vector3f::UnitX()) *
                                  Eigen::AngleAxisf(number(), Vector3f::UnitZ());
  const Vector3f shift(number(), number(), number());
  Mesh moved = mesh;
  for (Vector3f& vertex : moved.vertices) vertex = turn * vertex + shift;
  const ReebGraph a = reeb_graph(mesh), b = reeb_graph(moved);
  for (size_t level = 0; level < 5; ++level) {
    RC_ASSERT(difference(a.levels[level], b.levels[level]) < 0.08);
  }
}

RC_GTEST_PROP(ReebGraph, does_not_depend_on_the_order_of_vertices_and_triangles, ()) {
  const Mesh mesh = figures::surface(any_body(), 0.04);
  std::mt19937 random(static_cast<unsigned>(*rc::gen::inRange(0, 1000)));
  std::vector<uint32_t> order(mesh.vertices.size());
  std::iota(order.begin(), order.end(), 0U);
  std::shuffle(order.begin(), order.end(), random);
  Mesh other;
  other.vertices.resize(order.size());
  for (size_t v = 0; v < order.size(); ++v) other.vertices[order[v]] = mesh.vertices[v];
  for (const auto& [a, b, c] : mesh.triangles) {
    other.triangles.push_back({order[a], order[b], order[c]});
  }
  std::shuffle(other.triangles.begin(), other.triangles.end(), random);
  const double similarity = graph_similarity(reeb_graph(mesh), reeb_graph(other));
  RC_ASSERT(similarity > 0.9);  // ties of distances on the lattice of voxels
}

}  // namespace
}  // namespace v3d::recon
