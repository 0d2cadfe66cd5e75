#include <gtest/gtest.h>

#include "recon/render/renderer.h"
#include "recon/shapes.h"

namespace v3d::recon {
namespace {

using Eigen::Vector3d;

constexpr double kPixelRad = 0.001;
const Vector3d kEye(4, 0.1, 2);

Mesh box_at_height(float z) { return shapes::box({-0.3F, -0.3F, z}, {0.3F, 0.3F, z + 1}); }

std::optional<FloorHit> hit_at(const Floor& floor, const Vector3d& position) {
  return floor.hit(kEye, (position - kEye).normalized(), kPixelRad);
}

TEST(Floor, is_hit_where_a_ray_reaches_its_height) {
  const Floor floor(box_at_height(0), {.z = 0.5});
  const Vector3d position(1, 2, 0.5);
  const auto hit = hit_at(floor, position);
  ASSERT_TRUE(hit);
  EXPECT_NEAR(hit->distance_m, (position - kEye).norm(), 1e-9);
}

TEST(Floor, is_not_hit_by_rays_that_go_up_or_begin_below) {
  const Floor floor(box_at_height(0), {});
  EXPECT_FALSE(floor.hit(kEye, Vector3d(-1, 0, 0.1).normalized(), kPixelRad));
  EXPECT_FALSE(floor.hit(kEye, Vector3d(-1, 0, 0), kPixelRad));
  EXPECT_FALSE(floor.hit({0, 0, -1}, {0, 0, -1}, kPixelRad));
}

TEST(Floor, has_grid_lines_lighter_than_the_cells) {
  const Floor floor(box_at_height(0), {.grid_m = 0.5});
  const float between = hit_at(floor, {0.75, 0.75, 0})->light;
  EXPECT_GT(hit_at(floor, {1.0, 0.75, 0})->light, 1.5F * between);
  EXPECT_GT(hit_at(floor, {0.75, -0.5, 0})->light, 1.5F * between);
  EXPECT_GT(between, 0);
}

TEST(Floor, fades_with_the_distance_from_objects) {
  const Floor floor(box_at_height(0), {});
  EXPECT_LT(hit_at(floor, {-6, 0, 0})->light, hit_at(floor, {-1, 0, 0})->light / 10);
}

TEST(Floor, is_darkest_below_an_object_and_bright_a_metre_beside) {
  const Floor floor(box_at_height(0), {.shadow_depth = 0.5});
  EXPECT_NEAR(hit_at(floor, {0, 0, 0})->shadow, 0.5F, 0.02F);
  const float edge = hit_at(floor, {0.3, 0, 0})->shadow;
  EXPECT_GT(edge, 0.15F);
  EXPECT_LT(edge, 0.4F);
  EXPECT_EQ(hit_at(floor, {1.3, 0, 0})->shadow, 0);
}

TEST(Floor, is_less_dark_below_higher_objects) {
  const Floor standing(box_at_height(0), {}), jumping(box_at_height(0.6F), {});
  const float expected = hit_at(standing, {0, 0, 0})->shadow * std::exp(-1.0F);
  ASSERT_GT(expected, 0.1F);
  EXPECT_NEAR(hit_at(jumping, {0, 0, 0})->shadow, expected, 0.02F);
}

TEST(Floor, has_the_shadow_of_an_object_also_where_another_one_is_far_away) {
  for (const float far_m : {30.0F, 100.0F}) {
    Mesh objects = box_at_height(0);
    shapes::append(objects, shapes::box({far_m, 0, 0}, {far_m + 0.5F, 0.5F, 1}));
    const Floor floor(objects, {.shadow_depth = 0.5});
    EXPECT_NEAR(hit_at(floor, {0, 0, 0})->shadow, 0.5F, 0.02F) << far_m;
    EXPECT_NEAR(hit_at(floor, {1.3, 0, 0})->shadow, 0, 1e-3F) << far_m;
  }
}

TEST(Floor, has_lines_and_no_shadow_without_objects) {
  const Floor floor(Mesh{}, {});
  const auto hit = hit_at(floor, {0.5, 0.1, 0});
  ASSERT_TRUE(hit);
  EXPECT_GT(hit->light, 0.1F);
  EXPECT_EQ(hit->shadow, 0);
}

}  // namespace
}  // namespace v3d::recon
