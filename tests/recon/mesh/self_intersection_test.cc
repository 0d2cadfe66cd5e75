#include "recon/mesh/self_intersection.h"

#include <gtest/gtest.h>

#include <random>

#include "recon/shapes.h"

namespace v3d::recon {
namespace {

TEST(SelfIntersection, a_ball_has_none) {
  EXPECT_EQ(self_intersections(shapes::sphere({0, 0, 0}, 1, 30)).size(), 0);
  EXPECT_EQ(self_intersections({}).size(), 0);
}

TEST(SelfIntersection, counts_a_spike_through_a_plate) {
  // Through the first of the plate's two triangles.
  Mesh mesh;
  mesh.vertices = {{-1, -1, 0},  {1, -1, 0},      {1, 1, 0},         {-1, 1, 0},
                   {0.3F, 0, 1}, {0.3F, 0.1F, 1}, {0.25F, 0.05F, -1}};
  mesh.triangles = {{0, 1, 2}, {0, 2, 3}, {4, 5, 6}};
  EXPECT_EQ(self_intersections(mesh), (std::vector<Crossing>{{0, 2}}));
}

TEST(SelfIntersection, finds_every_pair_that_a_search_through_all_pairs_finds) {
  std::mt19937 random(11);
  const auto unit = [&] { return static_cast<float>(random() % 10'000) / 10'000; };
  Mesh mesh;
  for (uint32_t t = 0; t < 300; ++t) {
    const Eigen::Vector3f at(unit(), unit(), unit());
    for (int k = 0; k < 3; ++k) {
      mesh.vertices.push_back(at + 0.3F * Eigen::Vector3f(unit(), unit(), unit()));
    }
    mesh.triangles.push_back({3 * t, 3 * t + 1, 3 * t + 2});
  }
  std::vector<Crossing> expected, of_first_ten;
  for (size_t s = 0; s < mesh.triangles.size(); ++s) {
    for (size_t t = s + 1; t < mesh.triangles.size(); ++t) {
      const Mesh pair{mesh.vertices, {mesh.triangles[s], mesh.triangles[t]}, {}};
      if (self_intersections(pair).empty()) continue;
      expected.emplace_back(s, t);
      if (s < 10) of_first_ten.emplace_back(s, t);
    }
  }
  EXPECT_GT(expected.size(), 100);
  EXPECT_EQ(self_intersections(mesh), expected);
  std::vector<uint8_t> corners_of_first_ten(mesh.vertices.size(), 0);
  std::fill_n(corners_of_first_ten.begin(), 30, 1);
  EXPECT_EQ(CrossingFinder(mesh).of_moved(corners_of_first_ten), of_first_ten);
}

TEST(SelfIntersection, detects_a_ball_that_was_pushed_through_itself) {
  Mesh ball = shapes::sphere({0, 0, 0}, 1, 30);
  for (Eigen::Vector3f& v : ball.vertices) {
    if (v.x() > 0.8F) v.x() -= 2.5F;
  }
  EXPECT_GT(self_intersections(ball).size(), 10);
}

TEST(SelfIntersection, finds_crossings_of_moved_vertices_and_none_after_they_return) {
  const Mesh round = shapes::sphere({0, 0, 0}, 1, 30);
  Mesh ball = round;
  CrossingFinder finder(ball);
  EXPECT_TRUE(finder.all().empty());
  std::vector<uint8_t> moved(ball.vertices.size(), 0);
  for (size_t v = 0; v < moved.size(); ++v) moved[v] = ball.vertices[v].x() > 0.8F;
  for (size_t v = 0; v < moved.size(); ++v) {
    if (moved[v]) ball.vertices[v].x() -= 2.5F;
  }
  const std::vector<Crossing> crossings = finder.of_moved(moved);
  EXPECT_GT(crossings.size(), 10);
  EXPECT_EQ(crossings, self_intersections(ball));
  ball.vertices = round.vertices;
  EXPECT_TRUE(finder.of_moved(moved).empty());
}

}  // namespace
}  // namespace v3d::recon
