#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <cstring>
#include <iterator>
#include <nlohmann/json.hpp>
#include <numbers>
#include <sstream>
#include <string>
#include <vector>

#include "base/core/error.h"
#include "support/message_of.h"
#include "tools/glb.h"
#include "tools/turning_skeleton.h"
#include "v3dctl/skeleton/take_skeleton.h"

namespace v3d::ctl {
namespace {

using test::turning;
using testing::HasSubstr;

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

TEST(SkeletonFiles, have_the_prop_at_the_hand_that_holds_it_as_json_and_bvh) {
  TakeSkeleton skeleton = turning(2);
  skeleton.structure.has_prop = true;
  skeleton.structure.prop_hand = recon::kLeftWrist;
  const auto file = nlohmann::json::parse(skeleton_json(skeleton));
  ASSERT_EQ(file.at("joints").size(), 17U);
  EXPECT_EQ(file.at("joints")[15].at("parent"), "left_wrist");
  EXPECT_EQ(file.at("joints")[16].at("parent"), "prop_base");
  const std::string bvh = skeleton_bvh(skeleton);
  const size_t prop = bvh.find("JOINT prop_base");
  EXPECT_GT(prop, bvh.find("JOINT left_wrist"));
  EXPECT_LT(prop, bvh.find("JOINT right_shoulder"));
}

TEST(SkeletonFiles, are_not_written_as_bvh_with_more_than_a_million_rows) {
  TakeSkeleton skeleton = turning(3);
  skeleton.pulses[2] = 1'000'000'000'000;
  EXPECT_EQ(test::message_of<InputError>([&] { skeleton_bvh(skeleton); }),
            "--export bvh: a row for each pulse from 10 to 1000000000000; expected at most "
            "1,000,000: choose some by --frames");
}

TEST(SkeletonFiles, have_the_weights_of_tracked_surfaces_as_bytes) {
  TakeSkeleton skeleton = turning(4);
  skeleton.tracked.resize(2);
  skeleton.tracked[1].pulses = {11, 12, 13};
  skeleton.skins.resize(2);  // the first surface has no skin
  skeleton.skins[1].influences = {
      {.part = {recon::kNeck, recon::kHead, recon::kPropTip, recon::kPelvis},
       .weight = {0.7F, 0.3F, 0, 0}}};
  const auto file = nlohmann::json::parse(skeleton_json(skeleton));
  ASSERT_EQ(file.at("skins").size(), 1U);
  EXPECT_EQ(file.at("skins")[0].at("pulses"), (std::vector<int64_t>{11, 12, 13}));
  EXPECT_EQ(file.at("skins")[0].at("vertices"), 1);
  // Joints 1, 2, and 0 for unused entries; weights 178, 77, 0, 0 of 255.
  EXPECT_EQ(file.at("skins")[0].at("weights"), "AQIAALJNAAA=");
  EXPECT_FALSE(nlohmann::json::parse(skeleton_json(skeleton, false)).contains("skins"));
}

TEST(SkeletonFiles, have_one_row_for_each_pulse_and_three_columns_for_each_joint_as_trc) {
  const std::string text = skeleton_trc(turning(3), "a.trc");
  EXPECT_EQ(std::ranges::count(text, '\n'), 6 + 3);
  const std::string row = text.substr(text.rfind('\n', text.size() - 2) + 1);
  EXPECT_EQ(std::ranges::count(row, '\t'), 1 + 3 * 15);
  // World (1, 2, 0.93) with y up.
  EXPECT_THAT(row, HasSubstr("3\t0.480000\t1.000000\t0.930000\t-2.000000"));
}

/// The fields of a line, between tabs.
std::vector<std::string> fields_of(const std::string& line) {
  std::vector<std::string> fields;
  std::istringstream in(line);
  for (std::string field; std::getline(in, field, '\t');) fields.push_back(field);
  return fields;
}

/// The header in OpenSim's documentation, "Marker (.trc) files". Pose2Sim takes the names of
/// markers from every third field after the second one of the fourth line.
TEST(SkeletonFiles, have_every_field_of_the_header_that_opensim_documents_as_trc) {
  TakeSkeleton skeleton = turning(3);
  skeleton.pulses[2] = 13;  // pulse 12 has no mesh
  std::istringstream in(skeleton_trc(skeleton, "a.trc"));
  std::vector<std::vector<std::string>> lines;
  for (std::string line; std::getline(in, line);) lines.push_back(fields_of(line));
  ASSERT_EQ(lines.size(), 6U + 3U);
  EXPECT_EQ(lines[0], (std::vector<std::string>{"PathFileType", "4", "(X/Y/Z)", "a.trc"}));
  EXPECT_EQ(lines[1],
            (std::vector<std::string>{"DataRate", "CameraRate", "NumFrames", "NumMarkers", "Units",
                                      "OrigDataRate", "OrigDataStartFrame", "OrigNumFrames"}));
  EXPECT_EQ(lines[2], (std::vector<std::string>{"25", "25", "3", "15", "m", "25", "1", "3"}));
  EXPECT_EQ(lines[3][0], "Frame#");
  EXPECT_EQ(lines[3][1], "Time");
  for (size_t j = 0; j < 15; ++j) {
    const std::string number = std::to_string(j + 1);
    EXPECT_EQ(lines[3].at(2 + 3 * j), recon::name(static_cast<recon::Joint>(j)));
    EXPECT_EQ(lines[4].at(2 + 3 * j), "X" + number);
    EXPECT_EQ(lines[4].at(3 + 3 * j), "Y" + number);
    EXPECT_EQ(lines[4].at(4 + 3 * j), "Z" + number);
  }
  EXPECT_TRUE(lines[5].empty());
  for (size_t n = 0; n < 3; ++n) EXPECT_EQ(lines[6 + n].size(), 2U + 3 * 15);
  EXPECT_EQ(lines[8][0], "3");
  EXPECT_EQ(lines[8][1], "0.520000") << "the time of the pulse";
}

TEST(SkeletonFiles, turn_the_root_of_a_bvh_file_about_its_vertical_axis) {
  const std::string text = skeleton_bvh(turning(2));
  EXPECT_THAT(text, HasSubstr("ROOT pelvis"));
  EXPECT_THAT(text, HasSubstr("Frames: 2\nFrame Time: 0.0400000000\n"));
  // Position with y up; then the angles about z, x and y.
  EXPECT_THAT(text, HasSubstr("\n2.000000 0.930000 1.000000 "));
  EXPECT_THAT(text, HasSubstr(" 28.647890 "));
}

TEST(SkeletonFiles, keep_the_time_within_a_tenth_of_a_frame_for_an_hour_at_240_hz_as_bvh) {
  TakeSkeleton skeleton = turning(2);
  skeleton.rate_hz = 240;
  const std::string text = skeleton_bvh(skeleton);
  const double period_s = std::stod(text.substr(text.find("Frame Time: ") + 12));
  EXPECT_NEAR(period_s * 240 * 3600 * 240, 3600 * 240, 0.1);
}

/// The rows of a BVH file: six numbers for each joint.
std::vector<std::string> bvh_rows(const std::string& text) {
  std::vector<std::string> rows;
  std::istringstream lines(text.substr(text.find("Frame Time")));
  std::string line;
  std::getline(lines, line);
  while (std::getline(lines, line)) rows.push_back(line);
  return rows;
}

TEST(SkeletonFiles, have_a_row_for_each_time_as_bvh_also_for_pulses_without_a_skeleton) {
  TakeSkeleton skeleton = turning(3);
  skeleton.pulses = {10, 11, 14};
  const std::string text = skeleton_bvh(skeleton);
  EXPECT_THAT(text, HasSubstr("Frames: 5\nFrame Time: 0.0400000000\n"));
  const std::vector<std::string> rows = bvh_rows(text);
  ASSERT_EQ(rows.size(), 5U);
  const std::vector<std::string> whole = bvh_rows(skeleton_bvh(turning(3)));
  EXPECT_EQ(rows[1], whole[1]);
  EXPECT_EQ(rows[4], whole[2]);
  // The person turns from 0.5 to 1 rad from pulse 11 to 14: 38.2 degrees at pulse 12.
  EXPECT_THAT(rows[2], HasSubstr(" 38.197186 "));
}

std::vector<double> numbers_of(const std::string& row) {
  std::istringstream in(row);
  return {std::istream_iterator<double>(in), {}};
}

TEST(SkeletonFiles, have_no_jump_between_the_angles_of_rows_as_bvh) {
  constexpr double kDegree = std::numbers::pi / 180;
  TakeSkeleton skeleton = turning(30);  // more than two turns
  for (size_t n = 0; n < skeleton.structure.pulses.size(); ++n) {
    const double lean = (n % 2 == 0 ? 1 : -1) * (1 + 0.1 * static_cast<double>(n)) * kDegree;
    auto& pelvis = skeleton.structure.pulses[n].rotations[recon::kPelvis];
    pelvis = Eigen::Matrix3d(pelvis * Eigen::AngleAxisd(lean, Eigen::Vector3d::UnitX()));
  }
  const std::vector<std::string> rows = bvh_rows(skeleton_bvh(skeleton));
  ASSERT_EQ(rows.size(), 30U);
  for (size_t n = 0; n < rows.size(); ++n) {
    const std::vector<double> row = numbers_of(rows[n]);
    // The columns of the root: position, then the angles about z, x and y. z of the file is x here.
    const Eigen::Matrix3d rotation =
        (Eigen::AngleAxisd(row[3] * kDegree, Eigen::Vector3d::UnitX()) *
         Eigen::AngleAxisd(row[4] * kDegree, Eigen::Vector3d::UnitY()) *
         Eigen::AngleAxisd(row[5] * kDegree, Eigen::Vector3d::UnitZ()))
            .toRotationMatrix();
    EXPECT_TRUE(rotation.isApprox(skeleton.structure.pulses[n].rotations[recon::kPelvis], 1e-6))
        << n;
    for (size_t column = 3; n > 0 && column < row.size(); ++column) {
      if (column % 6 < 3) continue;
      EXPECT_LT(std::abs(row[column] - numbers_of(rows[n - 1])[column]), 60)
          << "row " << n << ", column " << column;
    }
  }
}

TEST(SkeletonFiles, need_a_tracked_surface_as_glb) {
  EXPECT_EQ(test::message_of<InputError>([] { skeleton_glb(turning(2), "take"); }),
            "--export glb needs a tracked surface: run v3dctl track first");
}

/// The rotations of the first node of a name, at all keys: x, y, z and w of each.
std::vector<float> rotation_keys(const test::Glb& glb, const std::string& node) {
  const nlohmann::json& animation = glb.scene.at("animations")[0];
  for (const nlohmann::json& channel : animation.at("channels")) {
    const nlohmann::json& target = channel.at("target");
    if (target.at("path") != "rotation") continue;
    if (glb.scene.at("nodes")[target.at("node").get<size_t>()].at("name") != node) continue;
    const nlohmann::json& sampler = animation.at("samplers")[channel.at("sampler").get<size_t>()];
    const std::string bytes =
        glb.bytes_of(glb.scene.at("accessors")[sampler.at("output").get<size_t>()]);
    std::vector<float> keys(bytes.size() / sizeof(float));
    std::memcpy(keys.data(), bytes.data(), bytes.size());
    return keys;
  }
  ADD_FAILURE() << "no rotations of " << node;
  return {};
}

TEST(SkeletonFiles, pose_a_surface_at_a_shared_pulse_by_the_skeleton_of_its_segment_as_glb) {
  const test::Glb glb = test::parse_glb(skeleton_glb(test::with_a_shared_pulse(), "take"));
  const std::vector<float> keys = rotation_keys(glb, "left_elbow");
  ASSERT_EQ(keys.size(), 12U) << "three pulses";
  // The forearm turns with the upper arm.
  for (size_t c = 0; c < 4; ++c) EXPECT_NEAR(keys[8 + c], keys[c], 1e-5);
}

TEST(SkinError, is_that_of_the_skeleton_of_the_segment_at_a_shared_pulse) {
  const TakeSkeleton skeleton = test::with_a_shared_pulse();
  const SkinError error = skin_error(skeleton.tracked, skeleton.skins);
  EXPECT_EQ(error.pulses, 6);
  EXPECT_LT(error.p90_mm, 0.01);
}

}  // namespace
}  // namespace v3d::ctl
