#include <gtest/gtest.h>

#include <algorithm>

#include "recon/metrics/nearest_triangle.h"
#include "recon/shapes.h"

namespace v3d::recon {
namespace {

using Eigen::Vector3d;

TEST(SurfaceSamples, are_spread_by_area) {
  Mesh mesh = shapes::patch(1.5F, 0, 1);            // 9 square metres
  shapes::append(mesh, shapes::patch(0.5F, 1, 4));  // 1, of smaller triangles
  const auto samples = sample_surface(mesh, 1000, 7);
  ASSERT_EQ(samples.size(), 1000U);
  const auto upper =
      std::ranges::count_if(samples, [](const SurfaceSample& s) { return s.position.z() > 0.5; });
  EXPECT_NEAR(static_cast<double>(upper), 100, 1) << "stratified";
  Vector3d middle = Vector3d::Zero();
  for (const SurfaceSample& s : samples) middle += s.position / 1000;
  EXPECT_LT(middle.head<2>().norm(), 0.1) << "no corner is preferred";
}

TEST(SurfaceSamples, lie_on_the_surface_with_its_normals) {
  const Mesh ball = shapes::sphere({1, 2, 3}, 2, 60);
  for (const SurfaceSample& s : sample_surface(ball, 2000, 1)) {
    const Vector3d out = s.position - Vector3d(1, 2, 3);
    EXPECT_NEAR(out.norm(), 2, 0.005);
    EXPECT_NEAR(s.normal.norm(), 1, 1e-9);
    EXPECT_GT(s.normal.dot(out.normalized()), 0.999);
  }
}

TEST(SurfaceSamples, depend_only_on_the_seed) {
  const Mesh ball = shapes::sphere({0, 0, 0}, 1, 8);
  const auto positions = [&](uint64_t seed) {
    std::vector<Vector3d> found;
    for (const SurfaceSample& s : sample_surface(ball, 50, seed)) found.push_back(s.position);
    return found;
  };
  EXPECT_EQ(positions(3), positions(3));
  EXPECT_NE(positions(3), positions(4));
}

TEST(SurfaceSamples, are_none_without_area) {
  EXPECT_TRUE(sample_surface(Mesh{}, 100, 1).empty());
  Mesh flat;
  flat.vertices = {{0, 0, 0}, {1, 0, 0}, {2, 0, 0}};
  flat.triangles = {{0, 1, 2}};
  EXPECT_TRUE(sample_surface(flat, 100, 1).empty());
}

TEST(Interpolated, is_the_weighted_mean_of_the_values_at_the_corners) {
  Mesh mesh = shapes::patch(1, 0, 1);
  std::vector<Eigen::Vector3f> values(mesh.vertices.size(), {100, 100, 100});
  const auto& corners = mesh.triangles[1];
  values[corners[0]] = {1, 0, 0};
  values[corners[1]] = {0, 2, 0};
  values[corners[2]] = {0, 0, 4};
  EXPECT_LT((interpolated(mesh, values, 1, {0.5, 0.25, 0.25}) - Vector3d(0.5, 0.5, 1)).norm(),
            1e-12);
}

}  // namespace
}  // namespace v3d::recon
