#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

#include "sim/performer/performer.h"

namespace v3d::sim {
namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;
using Eigen::Vector3f;

Part ball(const Vector3d& center, double radius) {
  return make_ellipsoid(Material::kSkin, center, Matrix3d::Identity(), {radius, radius, radius}, 48,
                        32);
}

RC_GTEST_PROP(OuterSurface, distinguishes_inside_and_outside_of_a_ball, ()) {
  const Part part = ball({0.3, -0.2, 1}, 0.5);
  const auto coordinate = [] { return static_cast<float>(*rc::gen::inRange(-800, 800)) * 1e-3F; };
  const Vector3f offset(coordinate(), coordinate(), coordinate());
  const float distance = offset.norm();
  RC_PRE(std::abs(distance - 0.5F) > 0.01F);
  RC_ASSERT(is_inside(part.mesh, Vector3f(0.3F, -0.2F, 1) + offset) == (distance < 0.5F));
}

TEST(OuterSurface, drops_vertices_inside_another_part) {
  const std::vector<Part> parts = {ball({0, 0, 0}, 0.5), ball({0.1, 0, 0}, 0.1),
                                   ball({0.5, 0, 0}, 0.3)};
  const Mesh outer = outer_surface(parts, 1);
  ASSERT_FALSE(outer.triangles.empty());
  EXPECT_EQ(outer.colours.size(), outer.vertices.size());
  for (const Vector3f& v : outer.vertices) {
    EXPECT_GT(v.norm(), 0.49F);
    EXPECT_GT((v - Vector3f(0.5F, 0, 0)).norm(), 0.29F);
  }
}

TEST(OuterSurface, keeps_separate_parts_complete) {
  const std::vector<Part> parts = {ball({0, 0, 0}, 0.2), ball({1, 0, 0}, 0.2)};
  EXPECT_TRUE(is_watertight(outer_surface(parts, 1)));
}

TEST(OuterSurface, of_the_performer_has_no_vertex_inside_another_part) {
  const std::vector<Part> parts = performer_parts(1.0, 1);
  const Mesh outer = outer_surface(parts, 1);
  EXPECT_GT(outer.triangles.size(), 10000U);
  for (size_t i = 0; i < outer.vertices.size(); i += 501) {
    int inside = 0;
    for (const Part& part : parts) inside += is_inside(part.mesh, outer.vertices[i]);
    EXPECT_LE(inside, 1);  // rounding: a point may be inside its own part
  }
}

}  // namespace
}  // namespace v3d::sim
