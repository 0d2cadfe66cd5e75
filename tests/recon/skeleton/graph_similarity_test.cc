#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

#include <Eigen/Geometry>

#include "recon/figures.h"
#include "recon/skeleton/reeb_graph.h"

namespace v3d::recon {
namespace {

ReebGraph graph_of(double left, double right) {
  return reeb_graph(figures::surface(figures::person(left, right), 0.04));
}

RC_GTEST_PROP(GraphSimilarity, is_symmetric_and_between_zero_and_one, ()) {
  const auto angle = [] { return static_cast<double>(*rc::gen::inRange(0, 150)); };
  const ReebGraph a = graph_of(angle(), angle()), b = graph_of(angle(), angle());
  const double forth = graph_similarity(a, b), back = graph_similarity(b, a);
  RC_ASSERT(forth >= 0);
  RC_ASSERT(forth <= 1);
  RC_ASSERT(std::abs(forth - back) < 1e-9);
}

TEST(GraphSimilarity, is_one_for_equal_graphs_and_zero_for_no_graph) {
  const ReebGraph graph = graph_of(30, 60);
  EXPECT_NEAR(graph_similarity(graph, graph), 1, 1e-9);
  EXPECT_EQ(graph_similarity(graph, {}), 0);
  EXPECT_EQ(graph_similarity({}, {}), 0);
}

TEST(GraphSimilarity, does_not_change_when_a_person_turns_and_walks_on) {
  Mesh mesh = figures::surface(figures::person(30, 60), 0.04);
  const ReebGraph graph = reeb_graph(mesh);
  const Eigen::AngleAxisf turn(0.9F, Eigen::Vector3f::UnitZ());
  for (Eigen::Vector3f& v : mesh.vertices) v = turn * v + Eigen::Vector3f(3, -2, 0.2F);
  EXPECT_GT(graph_similarity(graph, reeb_graph(mesh)), 0.9);
}

TEST(MostSimilar, finds_the_pose_that_is_most_alike) {
  std::vector<ReebGraph> graphs;
  std::vector<int64_t> pulses;
  for (int angle = 0; angle <= 140; angle += 20) {
    graphs.push_back(graph_of(angle, 90));
    pulses.push_back(angle);
  }
  const std::vector<SimilarPulse> found = most_similar(graph_of(63, 90), graphs, pulses, 3, 1);
  ASSERT_EQ(found.size(), 3U);
  EXPECT_EQ(found[0].pulse, 60);
  EXPECT_GT(found[0].similarity, found[1].similarity);
}

TEST(MostSimilar, returns_one_of_pulses_that_are_near_each_other) {
  const std::vector<ReebGraph> graphs(10, graph_of(20, 20));
  const std::vector<int64_t> pulses{0, 1, 2, 3, 4, 5, 6, 7, 8, 9};
  const std::vector<SimilarPulse> found = most_similar(graphs[0], graphs, pulses, 10, 4);
  ASSERT_EQ(found.size(), 3U);
  EXPECT_EQ(found[0].pulse, 0);
  EXPECT_EQ(found[1].pulse, 4);
  EXPECT_EQ(found[2].pulse, 8);
}

TEST(MostSimilar, returns_pulses_that_are_far_apart_although_their_graphs_are_neighbours) {
  const std::vector<ReebGraph> graphs(5, graph_of(20, 20));
  const std::vector<int64_t> pulses{0, 1, 20, 21, 40};
  const std::vector<SimilarPulse> found = most_similar(graphs[0], graphs, pulses, 10, 4);
  ASSERT_EQ(found.size(), 3U);
  EXPECT_EQ(found[0].pulse, 0);
  EXPECT_EQ(found[1].pulse, 20);
  EXPECT_EQ(found[2].pulse, 40);
}

}  // namespace
}  // namespace v3d::recon
