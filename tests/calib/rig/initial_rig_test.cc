#include "calib/rig/initial_rig.h"

#include <gtest/gtest.h>

namespace v3d::calib {
namespace {

const Box kSpace{{-1.5, -1, 0}, {1.5, 1, 2.2}};

TEST(GuessedRig, has_the_whole_space_in_every_image) {
  for (const ImageSize size : {ImageSize{1024, 768}, ImageSize{720, 1280}}) {
    for (const double across_deg : {20., 60., 120.}) {
      for (const RigCamera& camera : guessed_rig({"a", "b", "c"}, size, across_deg, kSpace)) {
        for (int corner = 0; corner < 8; ++corner) {
          const Eigen::Vector3d p(corner & 1 ? kSpace.max.x() : kSpace.min.x(),
                                  corner & 2 ? kSpace.max.y() : kSpace.min.y(),
                                  corner & 4 ? kSpace.max.z() : kSpace.min.z());
          const Eigen::Vector3d seen = camera.model.cam_from_world() * p;
          ASSERT_GT(seen.z(), 0);
          const Eigen::Vector2d pixel = (camera.model.matrix() * seen).hnormalized();
          EXPECT_TRUE(pixel.x() >= 0 && pixel.x() <= size.width) << pixel.transpose();
          EXPECT_TRUE(pixel.y() >= 0 && pixel.y() <= size.height) << pixel.transpose();
        }
      }
    }
  }
}

TEST(GuessedRig, keeps_the_order_of_the_cameras_and_their_distance_from_each_other) {
  const Rig rig = guessed_rig({"d", "a", "c", "b"}, {1024, 768}, 60, kSpace);
  ASSERT_EQ(rig.size(), 4U);
  EXPECT_EQ(rig[0].name, "d");
  EXPECT_EQ(rig[3].name, "b");
  const double side = (rig[0].model.center() - rig[1].model.center()).norm();
  for (size_t i = 0; i < 4; ++i) {
    EXPECT_NEAR((rig[i].model.center() - rig[(i + 1) % 4].model.center()).norm(), side, 1e-9);
    EXPECT_NEAR(rig[i].model.center().z(), kSpace.center().z(), 1e-9);
  }
}

TEST(GuessedRig, is_as_wide_as_was_said) {
  const Rig rig = guessed_rig({"a"}, {1000, 500}, 90, kSpace);
  EXPECT_NEAR(rig[0].model.matrix()(0, 0), 500, 1e-9);
  EXPECT_NEAR(rig[0].model.matrix()(1, 1), 500, 1e-9);
}

}  // namespace
}  // namespace v3d::calib
