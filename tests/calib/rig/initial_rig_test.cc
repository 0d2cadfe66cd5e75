#include <gtest/gtest.h>

#include "base/geometry/rigid_transform.h"
#include "calib/rig/rig_fit.h"

namespace v3d::calib {
namespace {

const Box kSpace{{-1.5, -1, 0}, {1.5, 1, 2.2}};

TEST(InitialRig, shows_the_whole_space_in_every_image) {
  for (const ImageSize size : {ImageSize{1024, 768}, ImageSize{720, 1280}}) {
    for (const double fov_deg : {20., 60., 120.}) {
      for (const RigCamera& camera : initial_rig({"a", "b", "c"}, size, fov_deg, kSpace)) {
        for (int corner = 0; corner < 8; ++corner) {
          const Eigen::Vector3d p(corner & 1 ? kSpace.max.x() : kSpace.min.x(),
                                  corner & 2 ? kSpace.max.y() : kSpace.min.y(),
                                  corner & 4 ? kSpace.max.z() : kSpace.min.z());
          const Eigen::Vector3d in_camera = camera.model.cam_from_world() * p;
          ASSERT_GT(in_camera.z(), 0);
          const Eigen::Vector2d pixel = (camera.model.matrix() * in_camera).hnormalized();
          EXPECT_TRUE(pixel.x() >= 0 && pixel.x() <= size.width) << pixel.transpose();
          EXPECT_TRUE(pixel.y() >= 0 && pixel.y() <= size.height) << pixel.transpose();
        }
      }
    }
  }
}

TEST(InitialRig, keeps_the_order_of_the_cameras_at_equal_distances) {
  const Rig rig = initial_rig({"d", "a", "c", "b"}, {1024, 768}, 60, kSpace);
  ASSERT_EQ(rig.size(), 4U);
  EXPECT_EQ(rig[0].name, "d");
  EXPECT_EQ(rig[3].name, "b");
  const double side = (rig[0].model.center() - rig[1].model.center()).norm();
  for (size_t i = 0; i < 4; ++i) {
    EXPECT_NEAR((rig[i].model.center() - rig[(i + 1) % 4].model.center()).norm(), side, 1e-9);
    EXPECT_NEAR(rig[i].model.center().z(), kSpace.center().z(), 1e-9);
  }
}

TEST(InitialRig, has_the_given_field_of_view) {
  const Rig rig = initial_rig({"a"}, {1000, 500}, 90, kSpace);
  EXPECT_NEAR(rig[0].model.matrix()(0, 0), 500, 1e-9);
  EXPECT_NEAR(rig[0].model.matrix()(1, 1), 500, 1e-9);
}

}  // namespace
}  // namespace v3d::calib
