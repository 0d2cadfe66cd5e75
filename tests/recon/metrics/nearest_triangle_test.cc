#include "recon/metrics/nearest_triangle.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <random>

#include "recon/shapes.h"

namespace v3d::recon {
namespace {

using Eigen::Vector3d;

double distance_to_edge(const Vector3d& p, const Vector3d& a, const Vector3d& b) {
  const double length2 = (b - a).squaredNorm();
  const double t = length2 > 0 ? std::clamp((p - a).dot(b - a) / length2, 0.0, 1.0) : 0;
  return (p - a - t * (b - a)).norm();
}

/// Distance to the plane if the foot of the perpendicular is inside, otherwise to the nearest edge.
double plain_distance(const Vector3d& p, const Vector3d& a, const Vector3d& b, const Vector3d& c) {
  double least = std::min({distance_to_edge(p, a, b), distance_to_edge(p, b, c),  //
                           distance_to_edge(p, c, a)});
  const Vector3d normal = (b - a).cross(c - a);
  if (normal.norm() < 1e-12) return least;
  const Vector3d n = normal.normalized(), foot = p - n.dot(p - a) * n;
  const auto left_of = [&](const Vector3d& from, const Vector3d& to) {
    return (to - from).cross(foot - from).dot(n) >= 0;
  };
  if (left_of(a, b) && left_of(b, c) && left_of(c, a))
    least = std::min(least, std::abs(n.dot(p - a)));
  return least;
}

class RandomPositions {
 public:
  explicit RandomPositions(unsigned seed) : random_(seed) {}
  Vector3d operator()(double reach) {
    std::uniform_real_distribution<double> along(-reach, reach);
    return {along(random_), along(random_), along(random_)};
  }

 private:
  std::mt19937 random_;
};

TEST(NearestWeights, give_the_nearest_point_of_a_triangle_for_any_query_point) {
  RandomPositions position(1);
  for (int i = 0; i < 20'000; ++i) {
    const Vector3d a = position(1), b = position(1), c = i % 50 == 0 ? a : position(1),
                   p = position(2);
    const Vector3d w = nearest_weights(p, a, b, c);
    EXPECT_NEAR(w.sum(), 1, 1e-9);
    EXPECT_GE(w.minCoeff(), -1e-12);
    const double found = (w.x() * a + w.y() * b + w.z() * c - p).norm();
    EXPECT_NEAR(found, plain_distance(p, a, b, c), 1e-9);
  }
}

TEST(NearestTriangle, equals_the_result_of_a_search_through_all_triangles) {
  Mesh mesh = shapes::sphere({0, 0, 0}, 1, 12);
  shapes::append(mesh, shapes::box({0.5F, 0.5F, 0.5F}, {2, 2, 2}));
  const NearestTriangle tree(mesh);
  RandomPositions position(2);
  for (int i = 0; i < 2'000; ++i) {
    const Vector3d p = position(2.5);
    double least = std::numeric_limits<double>::infinity();
    for (const auto& [a, b, c] : mesh.triangles) {
      least = std::min(
          least, plain_distance(p, mesh.vertices[a].cast<double>(), mesh.vertices[b].cast<double>(),
                                mesh.vertices[c].cast<double>()));
    }
    const auto found = tree.find(p);
    ASSERT_TRUE(found);
    EXPECT_NEAR(found->distance, least, 1e-9);
    Vector3d at = Vector3d::Zero();
    for (int k = 0; k < 3; ++k) {
      at += found->weights[k] * mesh.vertices[mesh.triangles[found->triangle][k]].cast<double>();
    }
    EXPECT_NEAR((at - p).norm(), least, 1e-9) << "the point that triangle and weights name";
  }
}

TEST(NearestTriangle, is_the_one_with_the_lowest_number_at_equal_distances) {
  Mesh mesh;
  for (int copy = 0; copy < 40; ++copy) shapes::append(mesh, shapes::patch(1, 0, 1));
  EXPECT_EQ(NearestTriangle(mesh).find({-0.5, -0.5, 1})->triangle, 0U);
  EXPECT_EQ(NearestTriangle(mesh).find({0.5, 0.5, 1})->triangle, 1U);
}

TEST(NearestTriangle, is_none_without_triangles) {
  Mesh mesh;
  mesh.vertices.emplace_back(0, 0, 0);
  EXPECT_FALSE(NearestTriangle(mesh).find({0, 0, 0}));
}

}  // namespace
}  // namespace v3d::recon
