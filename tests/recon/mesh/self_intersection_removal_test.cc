
#include <gtest/gtest.h>
#include <tbb/global_control.h>

#include <random>

#include "recon/mesh/self_intersection.h"
#include "recon/shapes.h"

namespace v3d::recon {
namespace {

constexpr float kBall = 1;

/// A ball whose vertices beyond x = 0.8 went through the opposite side.
Mesh pushed_through(const Mesh& ball) {
  Mesh mesh = ball;
  for (Eigen::Vector3f& v : mesh.vertices) {
    if (v.x() > 0.8F) v.x() -= 2.5F;
  }
  return mesh;
}

/// A ball with noise as large as its triangles.
Mesh crumpled(const Mesh& ball, uint32_t seed) {
  std::mt19937 random(seed);
  std::uniform_real_distribution<float> noise(-0.15F, 0.15F);
  Mesh mesh = ball;
  for (Eigen::Vector3f& v : mesh.vertices)
    v += Eigen::Vector3f(noise(random), noise(random), noise(random));
  return mesh;
}

Mesh on(const VertexLattice& lattice, Mesh mesh) {
  for (Eigen::Vector3f& v : mesh.vertices) v = rounded_to(lattice, v);
  return mesh;
}

TEST(SelfIntersectionRemoval, leaves_none_of_any_deformation) {
  const Mesh ball = shapes::sphere({0, 0, 0}, kBall, 20);
  for (uint32_t seed = 0; seed < 6; ++seed) {
    Mesh mesh = seed == 0 ? pushed_through(ball) : crumpled(ball, seed);
    ASSERT_GT(self_intersections(mesh).size(), 10U) << seed;
    EXPECT_EQ(remove_self_intersections(Neighbours(ball), ball.vertices, std::nullopt, mesh), 0U);
    EXPECT_TRUE(self_intersections(mesh).empty()) << seed;
  }
}

TEST(SelfIntersectionRemoval, puts_all_vertices_on_the_lattice_without_new_intersections) {
  const VertexLattice lattice{Eigen::Vector3d(0.1, -0.2, 0.3), 0.01};
  const Mesh ball = on(lattice, shapes::sphere({0, 0, 0}, kBall, 20));
  ASSERT_TRUE(self_intersections(ball).empty());
  Mesh mesh = crumpled(ball, 7);
  EXPECT_EQ(remove_self_intersections(Neighbours(ball), ball.vertices, lattice, mesh), 0U);
  EXPECT_TRUE(self_intersections(mesh).empty());
  EXPECT_EQ(on(lattice, mesh).vertices, mesh.vertices);
}

TEST(SelfIntersectionRemoval, moves_only_vertices_near_an_intersection) {
  const Mesh ball = shapes::sphere({0, 0, 0}, kBall, 30);
  Mesh mesh = ball;
  // A spike through the opposite side near the pole, and a bulge without an intersection.
  mesh.vertices.front() += Eigen::Vector3f(0.13F, 0.07F, -2.2F);
  const size_t bulge = mesh.vertices.size() / 2;
  mesh.vertices[bulge] *= 1.05F;
  const Mesh before = mesh;
  EXPECT_EQ(remove_self_intersections(Neighbours(ball), ball.vertices, std::nullopt, mesh), 0U);
  EXPECT_NE(mesh.vertices.front(), before.vertices.front());
  EXPECT_EQ(mesh.vertices[bulge], before.vertices[bulge]);
}

TEST(SelfIntersectionRemoval, changes_no_mesh_without_an_intersection) {
  const Mesh ball = shapes::sphere({0, 0, 0}, kBall, 15);
  Mesh mesh = ball;
  for (Eigen::Vector3f& v : mesh.vertices) v *= 1.2F;
  const Mesh before = mesh;
  EXPECT_EQ(remove_self_intersections(Neighbours(ball), ball.vertices, std::nullopt, mesh), 0U);
  EXPECT_EQ(mesh.vertices, before.vertices);
}

TEST(SelfIntersectionRemoval, counts_what_remains_of_a_start_that_intersects_itself) {
  Mesh start = shapes::sphere({0, 0, 0}, kBall, 12);
  shapes::append(start, shapes::sphere({1, 0.1F, 0.2F}, kBall, 12));
  Mesh mesh = start;
  const size_t remaining =
      remove_self_intersections(Neighbours(start), start.vertices, std::nullopt, mesh);
  EXPECT_EQ(remaining, self_intersections(mesh).size());
  EXPECT_GT(remaining, 0U);
}

TEST(SelfIntersectionRemoval, is_the_same_with_one_thread) {
  const Mesh ball = shapes::sphere({0, 0, 0}, kBall, 20);
  Mesh with_all = crumpled(ball, 3), with_one = with_all;
  remove_self_intersections(Neighbours(ball), ball.vertices, std::nullopt, with_all);
  const tbb::global_control one(tbb::global_control::max_allowed_parallelism, 1);
  remove_self_intersections(Neighbours(ball), ball.vertices, std::nullopt, with_one);
  EXPECT_EQ(with_all.vertices, with_one.vertices);
}

}  // namespace
}  // namespace v3d::recon
