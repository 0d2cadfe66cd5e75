#include "recon/motion/deformation_graph.h"

#include <gtest/gtest.h>
#include <tbb/global_control.h>
#include <tbb/task_arena.h>

#include <Eigen/Geometry>
#include <random>

#include "recon/shapes.h"

namespace v3d::recon {
namespace {

using Eigen::Vector3d;
using Eigen::Vector3f;

constexpr double kSpacingM = 0.06;

/// An upright capsule-like body of 1 m, with vertices about 2 cm apart.
Mesh body() {
  Mesh mesh = shapes::sphere({0, 0, 0}, 0.15F, 24);
  for (Vector3f& vertex : mesh.vertices) vertex.z() *= 3.3F;
  return mesh;
}

TEST(DeformationGraph, moves_each_vertex_by_near_nodes_with_weights_that_sum_to_one) {
  const Mesh mesh = body();
  const DeformationGraph graph(mesh, kSpacingM);
  EXPECT_GT(graph.nodes(), 50U);
  ASSERT_EQ(graph.influences().size(), mesh.vertices.size());
  for (size_t v = 0; v < mesh.vertices.size(); ++v) {
    const DeformationGraph::Influence& influence = graph.influences()[v];
    float sum = 0;
    for (int k = 0; k < DeformationGraph::kInfluences; ++k) {
      sum += influence.weight[k];
      if (influence.weight[k] == 0) continue;
      const Vector3d& node = graph.rest()[influence.node[k]];
      EXPECT_LT((node - mesh.vertices[v].cast<double>()).norm(), 2.2 * kSpacingM);
    }
    EXPECT_NEAR(sum, 1, 1e-5);
    EXPECT_GT(influence.weight[0], 0.25F) << "the nearest node";
  }
}

TEST(DeformationGraph, leaves_the_template_at_rest_and_moves_it_rigidly_with_its_nodes) {
  const Mesh mesh = body();
  const DeformationGraph graph(mesh, kSpacingM);
  std::vector<NodeMotion> motion = graph.rest_motion();
  std::vector<Vector3f> moved;
  graph.move(motion, mesh.vertices, moved);
  for (size_t v = 0; v < moved.size(); ++v) EXPECT_LT((moved[v] - mesh.vertices[v]).norm(), 1e-6F);

  const Eigen::Matrix3d turn =
      Eigen::AngleAxisd(0.7, Vector3d(1, 2, 3).normalized()).toRotationMatrix();
  const Vector3d shift(0.3, -0.2, 0.9);
  for (NodeMotion& node : motion) node = {turn, turn * node.position + shift};
  graph.move(motion, mesh.vertices, moved);
  for (size_t v = 0; v < moved.size(); ++v) {
    EXPECT_LT((moved[v].cast<double>() - turn * mesh.vertices[v].cast<double>() - shift).norm(),
              1e-6);
    EXPECT_LT((graph.rotation_at(motion, v) - turn).norm(), 1e-9);
  }
}

TEST(DeformationGraph, links_parts_that_nearly_touch_and_no_others) {
  Mesh mesh = shapes::sphere({0, 0, 0}, 0.1F, 10);
  const size_t first = mesh.vertices.size();
  shapes::append(mesh, shapes::sphere({0.25F, 0, 0}, 0.1F, 10));  // a gap of 5 cm
  const size_t second = mesh.vertices.size();
  shapes::append(mesh, shapes::sphere({1, 0, 0}, 0.1F, 10));
  const DeformationGraph graph(mesh, kSpacingM);
  const auto part_of = [&](uint32_t node) {
    const uint32_t vertex = graph.vertices_of_nodes()[node];
    return vertex < first ? 0 : vertex < second ? 1 : 2;
  };
  int links = 0;
  for (const DeformationGraph::Edge& edge : graph.edges()) {
    const int a = part_of(edge.a), b = part_of(edge.b);
    if (a == b) continue;
    EXPECT_EQ(a + b, 1) << "the third sphere is far away";
    ++links;
  }
  EXPECT_GT(links, 0);
}

TEST(LearnStiffness, is_largest_in_parts_that_moved_rigidly_and_small_at_the_hinge_between_them) {
  const Mesh mesh = body();
  DeformationGraph graph(mesh, kSpacingM);
  const auto is_upper = [&](uint32_t node) { return graph.rest()[node].z() > 0; };
  // The upper half turns around the x axis, which lies in the middle.
  std::vector<std::vector<NodeMotion>> motions;
  for (int i = 0; i < 8; ++i) {
    const Eigen::Matrix3d turn = Eigen::AngleAxisd(0.1 * i, Vector3d::UnitX()).toRotationMatrix();
    std::vector<NodeMotion>& motion = motions.emplace_back(graph.rest_motion());
    for (uint32_t n = 0; n < graph.nodes(); ++n) {
      if (is_upper(n)) motion[n] = {turn, turn * motion[n].position};
    }
  }
  learn_stiffness(graph, motions);
  int at_hinge = 0;
  for (const DeformationGraph::Edge& edge : graph.edges()) {
    if (is_upper(edge.a) == is_upper(edge.b)) {
      EXPECT_EQ(edge.stiffness, 10.0F);
    } else {
      EXPECT_LT(edge.stiffness, 1.0F);
      ++at_hinge;
    }
  }
  EXPECT_GT(at_hinge, 5);
}

/// Targets of every n-th vertex: all three coordinates of where `motion` moves it.
template <class Motion>
std::vector<VertexTarget> targets_of(const Mesh& mesh, size_t every, const Motion& motion) {
  std::vector<VertexTarget> targets;
  for (uint32_t v = 0; v < mesh.vertices.size(); v += static_cast<uint32_t>(every)) {
    for (int axis = 0; axis < 3; ++axis) {
      targets.push_back({v, 1, Vector3f::Unit(axis), motion(mesh.vertices[v])});
    }
  }
  return targets;
}

TEST(GraphSolver, finds_a_large_rigid_motion_from_few_vertices) {
  const Mesh mesh = body();
  const DeformationGraph graph(mesh, kSpacingM);
  GraphSolver solver(graph, mesh.vertices);
  const Eigen::AngleAxisf turn(0.8F, Vector3f(0, 1, 1).normalized());
  const auto rigid = [&](const Vector3f& p) -> Vector3f { return turn * p + Vector3f(0.4F, 0, 0); };
  std::vector<NodeMotion> motion = graph.rest_motion();
  solver.solve(targets_of(mesh, 20, rigid), {.rigidity = 10, .bending = 1, .iterations = 30},
               motion);
  std::vector<Vector3f> moved;
  graph.move(motion, mesh.vertices, moved);
  for (size_t v = 0; v < moved.size(); ++v) {
    EXPECT_LT((moved[v] - rigid(mesh.vertices[v])).norm(), 0.002F);
  }
}

TEST(GraphSolver, bends_less_where_the_edges_are_stiff) {
  const Mesh mesh = body();
  const auto bent = [](const Vector3f& p) -> Vector3f {
    return {p.x() + 0.3F * p.z() * p.z(), p.y(), p.z()};
  };
  const auto error_with = [&](float stiffness) {
    DeformationGraph graph(mesh, kSpacingM);
    for (DeformationGraph::Edge& edge : graph.edges()) edge.stiffness = stiffness;
    GraphSolver solver(graph, mesh.vertices);
    std::vector<NodeMotion> motion = graph.rest_motion();
    solver.solve(targets_of(mesh, 5, bent), {.rigidity = 1, .bending = 0.1, .iterations = 10},
                 motion);
    std::vector<Vector3f> moved;
    graph.move(motion, mesh.vertices, moved);
    double sum = 0;
    for (size_t v = 0; v < moved.size(); ++v) sum += (moved[v] - bent(mesh.vertices[v])).norm();
    return sum / static_cast<double>(moved.size());
  };
  EXPECT_LT(error_with(0.1F), 0.003);
  EXPECT_GT(error_with(1000), 3 * error_with(0.1F));
}

TEST(GraphSolver, gives_the_same_bits_with_any_number_of_threads) {
  const Mesh mesh = body();
  const DeformationGraph graph(mesh, kSpacingM);
  std::mt19937 random(5);
  std::normal_distribution<float> noise(0, 0.02F);
  const std::vector<VertexTarget> targets = targets_of(mesh, 3, [&](const Vector3f& p) -> Vector3f {
    return p + Vector3f(noise(random), noise(random), noise(random));
  });
  const tbb::global_control allowed(tbb::global_control::max_allowed_parallelism, 4);
  std::vector<std::vector<NodeMotion>> results;
  for (const int threads : {1, 4}) {
    tbb::task_arena arena(threads);
    arena.execute([&] {
      GraphSolver solver(graph, mesh.vertices);
      std::vector<NodeMotion> motion = graph.rest_motion();
      solver.solve(targets, {}, motion);
      results.push_back(motion);
    });
  }
  for (size_t n = 0; n < graph.nodes(); ++n) {
    EXPECT_EQ(results[0][n].position, results[1][n].position);
    EXPECT_EQ(results[0][n].rotation, results[1][n].rotation);
  }
}

}  // namespace
}  // namespace v3d::recon
