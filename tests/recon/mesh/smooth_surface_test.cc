#include <gtest/gtest.h>
#include <tbb/task_arena.h>

#include <random>

#include "recon/mesh/mesh_neighbours.h"
#include "recon/shapes.h"

namespace v3d::recon {
namespace {

using Eigen::Vector3f;

constexpr float kRadius = 0.5F;

const Mesh& ball() {
  static const Mesh kBall = shapes::sphere({1, 2, 3}, kRadius, 24);
  return kBall;
}

float distance_from_middle(const Vector3f& vertex) { return (vertex - Vector3f(1, 2, 3)).norm(); }

/// A ball with every vertex moved out or in by up to `max_m`.
std::vector<Vector3f> rough_ball(float max_m) {
  std::mt19937 random(3);
  std::uniform_real_distribution<float> way(-max_m, max_m);
  std::vector<Vector3f> vertices = ball().vertices;
  for (Vector3f& v : vertices) v += way(random) * (v - Vector3f(1, 2, 3)) / kRadius;
  return vertices;
}

float mean_radius(const std::vector<Vector3f>& vertices) {
  double sum = 0;
  for (const Vector3f& v : vertices) sum += distance_from_middle(v);
  return static_cast<float>(sum / static_cast<double>(vertices.size()));
}

float mean_roughness(const std::vector<Vector3f>& vertices) {
  double sum = 0;
  for (const Vector3f& v : vertices) sum += std::abs(distance_from_middle(v) - kRadius);
  return static_cast<float>(sum / static_cast<double>(vertices.size()));
}

TEST(InternalForce, points_to_the_mean_of_the_neighbours) {
  Mesh mesh = shapes::box({0, 0, 0}, {1, 1, 1});
  const Neighbours neighbours(mesh);
  mesh.vertices[0] = {-3, 0.5F, 7};
  Vector3f mean = Vector3f::Zero();
  for (const uint32_t n : neighbours.of(0)) mean += mesh.vertices[n];
  mean /= static_cast<float>(neighbours.of(0).size());
  EXPECT_LT((internal_force(neighbours, mesh.vertices, 0) - (mean - mesh.vertices[0])).norm(),
            1e-6);
}

TEST(InternalForce, is_none_on_a_vertex_without_neighbours) {
  Mesh lonely;
  lonely.vertices.emplace_back(1, 2, 3);
  EXPECT_EQ(internal_force(Neighbours(lonely), lonely.vertices, 0), Vector3f::Zero());
}

TEST(SmoothSurface, removes_most_of_the_roughness_and_does_not_shrink) {
  const Neighbours neighbours(ball());
  std::vector<Vector3f> vertices = rough_ball(0.01F), work;
  const float before = mean_roughness(vertices);
  ASSERT_GT(before, 0.004F);
  smooth_surface(neighbours, 10, vertices, work);
  EXPECT_LT(mean_roughness(vertices), before / 2);
  EXPECT_NEAR(mean_radius(vertices), kRadius, 0.005F * kRadius);
}

TEST(SmoothSurface, without_a_pass_changes_nothing) {
  std::vector<Vector3f> vertices = rough_ball(0.01F), work;
  smooth_surface(Neighbours(ball()), 0, vertices, work);
  EXPECT_EQ(vertices, rough_ball(0.01F));
}

TEST(SmoothSurface, steps_by_half_to_the_mean_of_the_neighbours_and_by_0_53_back) {
  const Neighbours neighbours(ball());
  const std::vector<Vector3f> start = rough_ball(0.02F);
  std::vector<Vector3f> forth = start, back = start;
  for (size_t v = 0; v < start.size(); ++v) {
    forth[v] = start[v] + 0.5F * internal_force(neighbours, start, v);
  }
  for (size_t v = 0; v < start.size(); ++v) {
    back[v] = forth[v] - 0.53F * internal_force(neighbours, forth, v);
  }
  std::vector<Vector3f> vertices = start, work;
  smooth_surface(neighbours, 1, vertices, work);
  for (size_t v = 0; v < start.size(); ++v) EXPECT_LT((vertices[v] - back[v]).norm(), 1e-6) << v;
}

TEST(SmoothSurface, returns_the_same_bits_for_any_number_of_threads) {
  const auto with_threads = [](int threads) {
    return tbb::task_arena(threads).execute([] {
      std::vector<Vector3f> vertices = rough_ball(0.02F), work;
      smooth_surface(Neighbours(ball()), 4, vertices, work);
      return vertices;
    });
  };
  EXPECT_EQ(with_threads(1), with_threads(3));
}

TEST(SmoothNormals, keep_unit_length_and_approach_those_of_the_smooth_ball) {
  const std::vector<Vector3f> truth = vertex_normals(ball());
  std::mt19937 random(8);
  std::normal_distribution<float> noise(0, 0.3F);
  std::vector<Vector3f> normals, work;
  for (const Vector3f& n : truth) {
    normals.push_back((n + Vector3f(noise(random), noise(random), noise(random))).normalized());
  }
  const auto mean_miss = [&] {
    double sum = 0;
    for (size_t v = 0; v < truth.size(); ++v) sum += (normals[v] - truth[v]).norm();
    return sum / static_cast<double>(truth.size());
  };
  const double before = mean_miss();
  smooth_normals(Neighbours(ball()), 3, normals, work);
  for (const Vector3f& n : normals) EXPECT_NEAR(n.norm(), 1, 1e-5);
  EXPECT_LT(mean_miss(), before / 2);
}

TEST(SmoothNormals, that_cancel_each_other_are_unchanged) {
  Mesh mesh;  // two triangles back to back
  mesh.vertices = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}};
  mesh.triangles = {{0, 1, 2}, {0, 2, 1}};
  const std::vector<Vector3f> opposed = {{1, 0, 0}, {-0.5F, 0, 0}, {-0.5F, 0, 0}};
  std::vector<Vector3f> normals = opposed, work;
  smooth_normals(Neighbours(mesh), 1, normals, work);
  EXPECT_EQ(normals, opposed);
}

}  // namespace
}  // namespace v3d::recon
