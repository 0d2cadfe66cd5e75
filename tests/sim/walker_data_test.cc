// The walker of the real data: a mannequin of closed surfaces, and Mixamo's skeleton.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>

#include "base/core/error.h"
#include "tools/real_recordings.h"
#include "v3d-sim/performer_file.h"

namespace v3d::sim {
namespace {

using Walker = test::RealRecordings;

TEST_F(Walker, is_a_body_of_closed_parts_with_all_main_joints) {
  const auto model = load_performer(data_ / "walker/walking.glb", "Walk");
  EXPECT_NEAR(model->height_m(), 1.8, 0.05);
  EXPECT_NEAR(model->extent().min().z(), 0, 1e-6);
  EXPECT_NEAR(model->period_s(), 29.0 / 30, 1e-3);
  for (const double t : {0.0, 0.37, 0.9}) {
    for (const Part& part : model->parts_at(t)) {
      ASSERT_TRUE(is_manifold(part.mesh)) << "at " << t;
      ASSERT_GT(enclosed_volume(part.mesh), 0) << "at " << t;
    }
  }
  const std::vector<JointDefinition> joints = model->joints();
  EXPECT_EQ(joints.size(), 65U);
  for (const std::string_view main : kMainJoints) {
    EXPECT_EQ(std::ranges::count(joints, main, &JointDefinition::main), 1) << main;
  }
}

TEST_F(Walker, walks_without_jumps_also_at_the_end_of_the_period) {
  const auto model = load_performer(data_ / "walker/walking.glb", "Walk");
  auto before = model->joint_positions(0);
  for (int i = 1; i < 250; ++i) {
    const auto now = model->joint_positions(0.01 * i);
    for (size_t j = 0; j < now.size(); ++j) ASSERT_LT((now[j] - before[j]).norm(), 0.06);
    before = now;
  }
}

TEST_F(Walker, is_rejected_with_the_names_of_its_animations) {
  EXPECT_THAT([&] { load_performer(data_ / "walker/walking.glb", "Run"); },
              testing::ThrowsMessage<InputError>(testing::HasSubstr("it has Idle, Walk")));
}

}  // namespace
}  // namespace v3d::sim
