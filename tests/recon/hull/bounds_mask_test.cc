#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "base/geometry/rigid_transform.h"
#include "recon/hull/voxel_grid.h"

namespace v3d::recon {
namespace {

CameraModel barrel_camera() {
  Eigen::Matrix3d matrix;
  matrix << 80, 0, 31.5, 0, 80, 23.5, 0, 0, 1;
  return {{64, 48}, matrix, {-0.3, 0.1}, look_at({2, 0.3, 0.4}, Eigen::Vector3d::Zero())};
}

TEST(BoundsMask, holds_every_pixel_to_which_a_point_of_the_box_projects) {
  const CameraModel camera = barrel_camera();
  const Box box{{-0.2, -0.9, -0.3}, {0.3, 0.1, 0.2}};
  const Mask view = bounds_mask(box, camera);
  std::mt19937 random(1);
  std::uniform_real_distribution<double> part(0, 1);
  for (int i = 0; i < 2000; ++i) {
    const Eigen::Vector3d at(part(random), part(random), part(random));
    const auto pixel = camera.project(box.min + at.cwiseProduct(box.size()));
    if (!pixel || !camera.inside_image(*pixel)) continue;
    EXPECT_TRUE(view.get(static_cast<int>(std::lround(pixel->x())),
                         static_cast<int>(std::lround(pixel->y()))))
        << pixel->transpose();
  }
}

TEST(BoundsMask, extends_at_most_a_block_beyond_the_box) {
  const CameraModel camera = barrel_camera();
  const Box box{{-0.1, -0.1, -0.1}, {0.1, 0.1, 0.1}};
  Eigen::Array2d low(64, 48);
  Eigen::Array2d high(0, 0);
  for (int corner = 0; corner < 8; ++corner) {
    const Eigen::Vector3d sign(corner & 1 ? 1 : -1, corner & 2 ? 1 : -1, corner & 4 ? 1 : -1);
    const Eigen::Array2d pixel = camera.project(0.1 * sign)->array();
    low = low.min(pixel);
    high = high.max(pixel);
  }
  const Rect seen = bounds_mask(box, camera).bounding_box();
  EXPECT_GE(seen.x0, low.x() - 4.5);
  EXPECT_GE(seen.y0, low.y() - 4.5);
  EXPECT_LE(seen.x0 + seen.width, high.x() + 5.5);
  EXPECT_LE(seen.y0 + seen.height, high.y() + 5.5);
}

TEST(BoundsMask, is_empty_for_a_box_behind_the_camera_and_full_from_inside) {
  const CameraModel camera = barrel_camera();
  EXPECT_EQ(bounds_mask({{3, -1, -1}, {5, 1, 1}}, camera).count(), 0);
  EXPECT_EQ(bounds_mask({{-5, -5, -5}, {5, 5, 5}}, camera).count(), 64 * 48);
}

}  // namespace
}  // namespace v3d::recon
