#include "recon/self_intersection.h"

#include <gtest/gtest.h>

#include <random>

#include "shapes.h"

namespace v3d {
namespace {

TEST(SelfIntersection, a_ball_has_none) {
  EXPECT_EQ(count_self_intersections(shapes::sphere({0, 0, 0}, 1, 30)), 0);
  EXPECT_EQ(count_self_intersections({}), 0);
}

TEST(SelfIntersection, counts_a_spike_through_a_plate) {
  // The spike's three sides go through two triangles of the plate, which share the edge it hits.
  Mesh mesh;
  mesh.vertices = {{-1, -1, 0},  {1, -1, 0},      {1, 1, 0},         {-1, 1, 0},
                   {0.3F, 0, 1}, {0.3F, 0.1F, 1}, {0.25F, 0.05F, -1}};
  mesh.triangles = {{0, 1, 2}, {0, 2, 3}, {4, 5, 6}};
  EXPECT_EQ(count_self_intersections(mesh), 1);
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
  int64_t expected = 0;
  for (size_t s = 0; s < mesh.triangles.size(); ++s) {
    for (size_t t = 0; t < s; ++t) {
      Mesh pair{mesh.vertices, {mesh.triangles[s], mesh.triangles[t]}, {}};
      expected += count_self_intersections(pair);
    }
  }
  EXPECT_GT(expected, 100);
  EXPECT_EQ(count_self_intersections(mesh), expected);
}

TEST(SelfIntersection, sees_a_ball_that_was_pushed_through_itself) {
  Mesh ball = shapes::sphere({0, 0, 0}, 1, 30);
  for (Eigen::Vector3f& v : ball.vertices) {
    if (v.x() > 0.8F) v.x() -= 2.5F;
  }
  EXPECT_GT(count_self_intersections(ball), 10);
}

}  // namespace
}  // namespace v3d
