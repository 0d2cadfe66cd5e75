#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <nlohmann/json.hpp>
#include <string>

#include "recon/skeleton/joint_rotations.h"
#include "v3dctl/skeleton/take_skeleton.h"

namespace v3d::ctl {
namespace {

using testing::HasSubstr;

/// A person who stands at (1, 2), and turns by 0.5 rad a pulse.
TakeSkeleton turning(size_t pulses) {
  TakeSkeleton skeleton;
  skeleton.rate_hz = 25;
  skeleton.structure.lengths = recon::BodyLengths(1.75, 0.5);
  for (size_t n = 0; n < pulses; ++n) {
    skeleton.pulses.push_back(static_cast<int64_t>(10 + n));
    recon::SkeletonPulse pulse;
    pulse.index = n;
    pulse.joints = recon::standing_pose(skeleton.structure.lengths, {1, 2, 0.93},
                                        0.5 * static_cast<double>(n));
    pulse.rotations = recon::joint_rotations(pulse.joints);
    skeleton.structure.pulses.push_back(pulse);
  }
  return skeleton;
}

TEST(SkeletonFiles, state_joints_lengths_and_positions_as_json) {
  const auto file = nlohmann::json::parse(skeleton_json(turning(2)));
  EXPECT_EQ(file.at("format"), "v3d-skeleton");
  ASSERT_EQ(file.at("joints").size(), 15U);
  EXPECT_TRUE(file.at("joints")[0].at("parent").is_null());
  EXPECT_EQ(file.at("joints")[1].at("parent"), "pelvis");
  EXPECT_NEAR(file.at("joints")[4].at("bone_m").get<double>(), 0.1618 * 1.75, 1e-4);
  ASSERT_EQ(file.at("pulses").size(), 2U);
  EXPECT_EQ(file.at("pulses")[1].at("pulse"), 11);
  EXPECT_NEAR(file.at("pulses")[0].at("positions")[0][1].get<double>(), 2, 1e-4);
}

TEST(SkeletonFiles, have_one_row_for_each_pulse_and_three_columns_for_each_joint_as_trc) {
  const std::string text = skeleton_trc(turning(3), "a.trc");
  EXPECT_EQ(std::ranges::count(text, '\n'), 6 + 3);
  const std::string row = text.substr(text.rfind('\n', text.size() - 2) + 1);
  EXPECT_EQ(std::ranges::count(row, '\t'), 1 + 3 * 15);
  // World (1, 2, 0.93) with y up.
  EXPECT_THAT(row, HasSubstr("3\t0.480000\t1.000000\t0.930000\t-2.000000"));
}

TEST(SkeletonFiles, turn_the_root_of_a_bvh_file_about_its_vertical_axis) {
  const std::string text = skeleton_bvh(turning(2));
  EXPECT_THAT(text, HasSubstr("ROOT pelvis"));
  EXPECT_THAT(text, HasSubstr("Frames: 2\nFrame Time: 0.040000\n"));
  // Position with y up; then the angles about z, x and y.
  EXPECT_THAT(text, HasSubstr("\n2.000000 0.930000 1.000000 "));
  EXPECT_THAT(text, HasSubstr(" 28.647890 "));
}

}  // namespace
}  // namespace v3d::ctl
