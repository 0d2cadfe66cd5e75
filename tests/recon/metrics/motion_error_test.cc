#include <gtest/gtest.h>

#include <Eigen/Geometry>

#include "recon/metrics/evaluation.h"
#include "recon/shapes.h"

namespace v3d::recon {
namespace {

using Eigen::Vector3f;

Mesh moved(Mesh mesh, const Eigen::Isometry3f& motion) {
  for (Vector3f& vertex : mesh.vertices) vertex = motion * vertex;
  return mesh;
}

Eigen::Isometry3f motion() {
  Eigen::Isometry3f motion = Eigen::Isometry3f::Identity();
  motion.rotate(Eigen::AngleAxisf(0.4F, Vector3f(1, 2, 0).normalized()));
  motion.pretranslate(Vector3f(0.2F, 0, -0.1F));
  return motion;
}

/// Points 5 mm outside a sphere, and one that is far away.
std::vector<Vector3f> points_near(const Mesh& sphere) {
  std::vector<Vector3f> points;
  for (size_t v = 0; v < sphere.vertices.size(); v += 5) {
    points.push_back(1.0125F * sphere.vertices[v]);
  }
  points.emplace_back(3, 0, 0);
  return points;
}

TEST(CarriedPoints, move_with_the_surface_at_their_distance_from_it) {
  const Mesh sphere = shapes::sphere({0, 0, 0}, 0.4F, 30);
  const std::vector<Vector3f> points = points_near(sphere);
  CarriedPoints carried(sphere, points);
  EXPECT_EQ(carried.bound(), std::ssize(points) - 1);
  EXPECT_FALSE(carried.is_bound(points.size() - 1));
  carried.follow(moved(sphere, motion()));
  for (size_t i = 0; i + 1 < points.size(); ++i) {
    EXPECT_LT((carried.positions()[i] - motion() * points[i]).norm(), 1e-4F);
  }
}

TEST(CarriedPoints, keep_their_velocity_when_another_surface_takes_over) {
  const Mesh sphere = shapes::sphere({0, 0, 0}, 0.4F, 30);
  const auto at = [&](float x) {
    return moved(sphere, Eigen::Isometry3f(Eigen::Translation3f(x, 0, 0)));
  };
  CarriedPoints carried(at(0), points_near(sphere));
  const std::vector<Vector3f> start = carried.positions();
  carried.follow(at(0.1F));
  Mesh other = shapes::sphere({0.2F, 0, 0}, 0.4F, 37);
  carried.change_surface_later(other);
  EXPECT_GT(carried.bound(), std::ssize(start) / 2);
  for (size_t i = 0; i < start.size(); ++i) {
    if (!carried.is_bound(i)) continue;
    EXPECT_LT((carried.positions()[i] - start[i] - Vector3f(0.2F, 0, 0)).norm(), 1e-4F);
  }
}

TEST(CarriedPoints, stay_bound_at_any_distance_when_another_surface_takes_over) {
  const Mesh sphere = shapes::sphere({0, 0, 0}, 0.4F, 30);
  CarriedPoints carried(sphere, sphere.vertices);
  const Mesh other = shapes::sphere({0.5F, 0, 0}, 0.4F, 37);
  carried.change_surface(other);
  EXPECT_EQ(carried.bound(), std::ssize(sphere.vertices));
  EXPECT_EQ(carried.positions(), sphere.vertices);
  carried.follow(moved(other, Eigen::Isometry3f(Eigen::Translation3f(0, 0.1F, 0))));
  for (size_t i = 0; i < sphere.vertices.size(); ++i) {
    EXPECT_LT((carried.positions()[i] - sphere.vertices[i] - Vector3f(0, 0.1F, 0)).norm(), 1e-4F);
  }
}

TEST(CarriedPoints, stay_behind_a_sliding_surface_when_they_drop_to_the_nearest_point) {
  // A sphere that turns: its shape does not change, so nearest points stay where they are.
  const Mesh sphere = shapes::sphere({0, 0, 0}, 0.4F, 60);
  const Eigen::Isometry3f turn(Eigen::AngleAxisf(0.3F, Vector3f::UnitZ()));
  CarriedPoints followed(sphere, sphere.vertices), dropped(sphere, sphere.vertices);
  followed.follow(moved(sphere, turn));
  dropped.move_to_nearest(moved(sphere, turn));
  const Mesh truth = moved(sphere, turn);
  const std::vector<Vector3f> normals = normals_at(truth, truth.vertices);
  const std::vector<uint8_t> all(truth.vertices.size(), 1);
  EXPECT_LT(end_point_error(followed, truth.vertices, normals, all).p90_mm, 0.1);
  const EndPointError error = end_point_error(dropped, truth.vertices, normals, all);
  EXPECT_GT(error.p50_mm, 50);
  EXPECT_NEAR(error.tangential_p50_mm, error.p50_mm, 0.1 * error.p50_mm);
}

TEST(EndPointError, counts_the_chosen_and_bound_points_and_divides_tangential_errors) {
  const Mesh patch = shapes::patch(1, 0, 10);  // faces +z
  const std::vector<Vector3f> points = {{0, 0, 0}, {0.5F, 0, 0}, {0, 0.5F, 0}, {9, 0, 0}};
  const CarriedPoints carried(patch, points);
  std::vector<Vector3f> truth = points;
  truth[0] += Vector3f(0.003F, 0, 0.004F);  // 5 mm, 3 of them along the surface
  truth[1] += Vector3f(0.1F, 0, 0);         // not chosen
  const std::vector<Vector3f> normals(4, Vector3f::UnitZ());
  const std::vector<uint8_t> chosen = {1, 0, 0, 1};
  const EndPointError error = end_point_error(carried, truth, normals, chosen);
  EXPECT_EQ(error.points, 1) << "the fourth is not bound";
  EXPECT_NEAR(error.p50_mm, 5, 1e-3);
  EXPECT_NEAR(error.tangential_p50_mm, 3, 1e-3);
}

}  // namespace
}  // namespace v3d::recon
