#include <gtest/gtest.h>

#include <algorithm>

#include "sim/performer/performer.h"
#include "sim/performer/skeleton.h"

namespace v3d::sim {
namespace {

TEST(Joints, of_the_swordsman_contain_every_main_joint_once) {
  const std::vector<JointDefinition> joints = joints_of({});
  for (const std::string_view main : kMainJoints) {
    EXPECT_EQ(std::ranges::count(joints, main, &JointDefinition::main), 1) << main;
  }
  EXPECT_EQ(joints.size(), joint_positions(0, {}).size());
}

TEST(Joints, of_the_swordsman_form_a_tree_with_bones_of_constant_length) {
  const std::vector<JointDefinition> joints = joints_of({});
  const auto first = joint_positions(0, {}), later = joint_positions(1.3, {});
  for (size_t j = 1; j < joints.size(); ++j) {
    const auto parent = static_cast<size_t>(joints[j].parent);
    ASSERT_LT(parent, j);
    const std::string& name = joints[j].name;
    if (name == "neck" || name == "head" || name == "sword_guard") continue;  // not rigid
    const double length = (first[j] - first[parent]).norm();
    EXPECT_GT(length, 0.05) << name;
    EXPECT_NEAR((later[j] - later[parent]).norm(), length, 1e-9) << name;
  }
}

TEST(Joints, of_the_swordsman_are_left_where_their_names_say_so) {
  const std::vector<JointDefinition> joints = joints_of({});
  const auto positions = joint_positions(0, {});  // looks along x, so that y is left
  const auto y_of = [&](const std::string& name) {
    const auto found = std::ranges::find(joints, name, &JointDefinition::name);
    return positions[static_cast<size_t>(found - joints.begin())].y();
  };
  for (const char* name : {"shoulder", "elbow", "hip", "knee", "ankle"}) {
    EXPECT_GT(y_of(std::string("left_") + name), y_of(std::string("right_") + name)) << name;
  }
}

TEST(Joints, are_found_by_the_names_of_common_programs) {
  EXPECT_EQ(main_joint_of("mixamorig:LeftArm"), "left_shoulder");
  EXPECT_EQ(main_joint_of("mixamorig:LeftShoulder"), "") << "the collarbone";
  EXPECT_EQ(main_joint_of("mixamorig:RightUpLeg"), "right_hip");
  EXPECT_EQ(main_joint_of("mixamorig:LeftHandIndex1"), "");
  EXPECT_EQ(main_joint_of("rightLowerLeg"), "right_knee");
  EXPECT_EQ(main_joint_of("upper_arm.L"), "left_shoulder");
  EXPECT_EQ(main_joint_of("Hips"), "pelvis");
  EXPECT_EQ(main_joint_of(""), "");
}

}  // namespace
}  // namespace v3d::sim
