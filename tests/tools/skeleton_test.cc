#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <csignal>
#include <cstdlib>
#include <iterator>
#include <nlohmann/json.hpp>
#include <numbers>
#include <sstream>
#include <stdexcept>
#include <string>
#include <vector>

#include "base/core/error.h"
#include "base/io/file.h"
#include "codec/motion_codec.h"
#include "common/console.h"
#include "recon/figures.h"
#include "recon/skeleton/body_model.h"
#include "support/message_of.h"
#include "support/temporary_folder.h"
#include "tools/glb.h"
#include "tools/gliding_take.h"
#include "v3dctl/command_line.h"
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
  EXPECT_THAT(text, HasSubstr("Frames: 2\nFrame Time: 0.040000\n"));
  // Position with y up; then the angles about z, x and y.
  EXPECT_THAT(text, HasSubstr("\n2.000000 0.930000 1.000000 "));
  EXPECT_THAT(text, HasSubstr(" 28.647890 "));
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
  EXPECT_THAT(text, HasSubstr("Frames: 5\nFrame Time: 0.040000\n"));
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

class LearntSkeleton : public testing::Test {
 protected:
  LearntSkeleton() { test::write_gliding_take(folder_ / "take"); }

  TakeSkeleton learn(int performer) {
    return learn_skeleton(
        folder_ / "take", {}, performer, [](int64_t) {}, [] {});
  }

  const test::TemporaryFolder folder_;
};

TEST_F(LearntSkeleton, is_not_that_of_another_performer_where_the_take_states_none) {
  EXPECT_EQ(learn(1).structure.pulses.size(), size_t{test::kGlidingPulses});
  EXPECT_EQ(test::message_of<InputError>([&] { learn(2); }),
            "--performer 2: pulse 0 of " + (folder_ / "take").string() +
                " does not state performers; expected a take after v3dctl performers");
}

/// Writes mesh.v3d of a person who stands still. All vertices are of performer 1, but for the last
/// one.
void write_meshes(const std::filesystem::path& take,
                  const std::vector<recon::figures::Capsule>& body, uint8_t of_last) {
  const Mesh person = recon::figures::surface(body, 0.025);
  std::vector<uint8_t> labels(person.vertices.size(), 1);
  labels.back() = of_last;
  test::write_still_meshes(take, person, labels);
}

void write_labelled_meshes(const std::filesystem::path& take, uint8_t of_last) {
  write_meshes(take, recon::figures::person(70, 50), of_last);
}

TEST(SkeletonDoubts, are_stated_where_no_pulse_shows_the_ends_of_a_body_or_it_is_not_upright) {
  recon::KinematicStructure structure = turning(4).structure;
  structure.good = 1;
  structure.upright = 2;
  EXPECT_THAT(doubts_about(structure), testing::IsEmpty());
  structure.good = 0;
  structure.upright = 1;
  EXPECT_THAT(doubts_about(structure),
              testing::ElementsAre(HasSubstr("no pulse shows head, feet and hands"),
                                   HasSubstr("it is wider than high at most pulses")));
  structure.good = structure.upright = 4;
  structure.lengths = recon::BodyLengths(2.2, 0.5);
  EXPECT_THAT(
      doubts_about(structure),
      testing::ElementsAre(HasSubstr("the stature would be 2.20 m, expected 1.2 to 2.1 m")));
}

TEST_F(LearntSkeleton, uses_the_tracked_surface_of_a_labelled_take_with_one_performer) {
  write_labelled_meshes(folder_ / "take", 1);
  EXPECT_EQ(learn(1).tracked.size(), 1U);
  write_labelled_meshes(folder_ / "take", 0);
  EXPECT_EQ(learn(1).tracked.size(), 1U) << "label 0: the performer is unknown";

  write_labelled_meshes(folder_ / "take", 2);
  const TakeSkeleton of_two = learn(1);
  EXPECT_THAT(of_two.tracked, testing::IsEmpty());
  EXPECT_EQ(test::message_of<InputError>([&] { skeleton_glb(of_two, "take"); }),
            "--export glb needs a tracked surface: motion.v3d is not used: the take has several "
            "performers");
}

using LearntSkeletonDeathTest = LearntSkeleton;

TEST_F(LearntSkeletonDeathTest, is_given_up_after_an_interrupt) {
  GTEST_FLAG_SET(death_test_style, "threadsafe");  // TBB has threads
  const auto learn = [&] {
    catch_interrupts();
    learn_skeleton(
        folder_ / "take", {}, 1, [](int64_t) { std::raise(SIGTERM); }, [] {});
  };
  const auto exit_after_interrupt = [&] {
    std::_Exit(test::message_of<std::runtime_error>(learn) == "interrupted" ? 7 : 0);
  };
  EXPECT_EXIT(exit_after_interrupt(), testing::ExitedWithCode(7), "");
}

class SkeletonCommand : public LearntSkeleton {
 protected:
  SkeletonCommand() { test::write_text(file_, "earlier"); }

  /// The exit status of `v3dctl skeleton WORDS`.
  static int run(std::vector<std::string> words) {
    words.insert(words.begin(), {"v3dctl", "skeleton"});
    std::vector<char*> argv;
    for (std::string& word : words) argv.push_back(word.data());
    return run_program(static_cast<int>(argv.size()), argv.data(), add_skeleton);
  }
  std::string path(const std::string& name) const { return (folder_ / name).string(); }

  const std::filesystem::path file_ = folder_ / "take" / "skeleton.json";
};

/// The bytes of an attribute at each corner of the triangles of the first surface.
std::vector<std::string> corner_values(const test::Glb& glb, const char* semantic) {
  const auto bytes_of = [&](const nlohmann::json& accessor) {
    const nlohmann::json& view = glb.scene["bufferViews"][accessor.at("bufferView").get<size_t>()];
    return glb.buffer.substr(view.at("byteOffset"), view.at("byteLength"));
  };
  const std::string numbers = bytes_of(glb.indices());
  const std::string values = bytes_of(glb.accessor(semantic));
  const size_t stride = values.size() / glb.accessor(semantic).at("count").get<size_t>();
  std::vector<std::string> corners;
  for (size_t at = 0; at < numbers.size(); at += sizeof(uint32_t)) {
    corners.push_back(values.substr(test::word_at(numbers, at) * stride, stride));
  }
  return corners;
}

TEST_F(SkeletonCommand, keeps_the_file_when_it_refuses_an_export) {
  // No segment has the three pulses that a skin needs.
  test::write_gliding_motion(take::TakePaths{folder_ / "take"}.motion(), {{0, 1}, {3, 4}, {6, 7}});
  testing::internal::CaptureStderr();
  EXPECT_EQ(run({path("take"), "--export", "glb", path("take.glb")}), kExitBadInput);
  EXPECT_THAT(testing::internal::GetCapturedStderr(), HasSubstr("glb needs a tracked surface"));
  EXPECT_EQ(read_file(file_), "earlier");
}

TEST_F(SkeletonCommand, exports_a_surface_whose_vertices_at_seams_keep_their_weights) {
  testing::internal::CaptureStderr();
  EXPECT_EQ(run({path("take"), "--export", "glb", path("take.glb"), "--atlas", "256"}),
            kExitIncomplete)
      << "no pulse shows hands";
  EXPECT_THAT(testing::internal::GetCapturedStderr(), HasSubstr("has no raw frames"));
  EXPECT_EQ(run({path("take"), "--export", "glb", path("plain.glb")}), kExitIncomplete);
  const test::Glb textured = test::parse_glb(read_file(path("take.glb")));
  const test::Glb plain = test::parse_glb(read_file(path("plain.glb")));
  EXPECT_EQ(textured.scene.at("images").size(), 1U);
  EXPECT_FALSE(plain.scene.contains("images"));
  EXPECT_EQ(textured.indices().at("count"), plain.indices().at("count"));
  const size_t vertices = textured.accessor("POSITION").at("count");
  EXPECT_GT(vertices, plain.accessor("POSITION").at("count").get<size_t>()) << "seams";
  EXPECT_EQ(textured.accessor("TEXCOORD_0").at("count"), vertices);
  for (const char* semantic : {"JOINTS_0", "WEIGHTS_0"}) {
    EXPECT_EQ(textured.accessor(semantic).at("count"), vertices);
    EXPECT_EQ(corner_values(textured, semantic), corner_values(plain, semantic)) << semantic;
  }
}

TEST_F(SkeletonCommand, has_a_texture_only_as_glb) {
  testing::internal::CaptureStderr();
  EXPECT_EQ(run({path("take"), "--export", "bvh", path("take.bvh"), "--atlas", "256"}),
            kExitBadInput);
  EXPECT_THAT(testing::internal::GetCapturedStderr(), HasSubstr("--atlas: expected --export glb"));
  EXPECT_EQ(read_file(file_), "earlier");
}

TEST_F(SkeletonCommand, keeps_the_file_when_it_cannot_write_the_other_one) {
  EXPECT_EQ(run({path("take"), "--export", "bvh", path("none/take.bvh")}), kExitFailed);
  EXPECT_EQ(read_file(file_), "earlier");
}

TEST_F(SkeletonCommand, keeps_the_file_when_the_truth_cannot_be_read) {
  EXPECT_EQ(run({path("take"), "--truth", path("none")}), kExitBadInput);
  EXPECT_EQ(read_file(file_), "earlier");
}

TEST_F(SkeletonCommand, is_incomplete_when_no_pulse_shows_head_feet_and_hands) {
  std::vector<recon::figures::Capsule> body = recon::figures::person(70, 50);
  // The arms are the first two of the five capsules of each side, after the four of the trunk.
  body.erase(body.begin() + 9, body.begin() + 11);
  body.erase(body.begin() + 4, body.begin() + 6);
  write_meshes(folder_ / "take", body, 1);
  std::filesystem::remove(take::TakePaths{folder_ / "take"}.motion());
  testing::internal::CaptureStdout();
  EXPECT_EQ(run({path("take")}), kExitIncomplete);
  EXPECT_THAT(testing::internal::GetCapturedStdout(),
              HasSubstr("no pulse shows head, feet and hands"));
  EXPECT_THAT(read_file(file_), HasSubstr("v3d-skeleton"));
}

TEST_F(SkeletonCommand, replaces_the_file_after_an_export) {
  EXPECT_EQ(run({path("take"), "--export", "bvh", path("take.bvh")}), kExitIncomplete)
      << "no pulse shows hands";
  EXPECT_THAT(read_file(path("take.bvh")), HasSubstr("ROOT pelvis"));
  EXPECT_THAT(read_file(file_), HasSubstr("v3d-skeleton"));
}

TEST_F(SkeletonCommand, lists_the_similar_poses_of_another_take) {
  test::write_gliding_take(folder_ / "other", 50);
  test::write_gliding_motion(take::TakePaths{folder_ / "other"}.motion(),
                             {{0, 1, 2}, {20, 21, 22}, {100, 101, 102}});
  testing::internal::CaptureStdout();
  EXPECT_EQ(run({path("take"), "--like", "3", "--in", path("other"), "--json"}), kExitDone);
  const auto json = nlohmann::json::parse(testing::internal::GetCapturedStdout());
  EXPECT_EQ(json.at("like"), 3);
  std::vector<int64_t> groups;
  for (const auto& pose : json.at("similar")) {
    groups.push_back(pose.at("pulse").get<int64_t>() / 50);
  }
  // Pulses 0 and 20 are less than half a second of the other take apart. Pulses near 3 are not left
  // out: that is a pulse of the first take.
  EXPECT_THAT(groups, testing::UnorderedElementsAre(0, 2));
  EXPECT_EQ(read_file(file_), "earlier");
}

TEST_F(SkeletonCommand, has_skeletons_up_to_the_pulse_at_which_the_studio_is_empty) {
  test::write_still_meshes(folder_ / "take",
                           recon::figures::surface(recon::figures::person(70, 50), 0.025), {}, 2);
  std::filesystem::remove(take::TakePaths{folder_ / "take"}.motion());
  testing::internal::CaptureStdout();
  EXPECT_EQ(run({path("take")}), kExitIncomplete);
  EXPECT_THAT(testing::internal::GetCapturedStdout(),
              HasSubstr("2 pulses without a body: the mesh is empty"));
  const auto pulses = nlohmann::json::parse(read_file(file_)).at("pulses");
  ASSERT_EQ(pulses.size(), size_t{test::kGlidingPulses} - 2);
  EXPECT_EQ(pulses.back().at("pulse"), test::kGlidingPulses - 3);
}

class SimilarPoses : public testing::Test {
 protected:
  SimilarPoses() { test::write_gliding_take(take_); }

  const test::TemporaryFolder folder_;
  const std::filesystem::path take_ = folder_ / "take";
};

TEST_F(SimilarPoses, are_half_a_second_apart_also_where_pulses_between_them_have_no_mesh) {
  test::write_gliding_motion(take::TakePaths{take_}.motion(),
                             {{0, 1, 2}, {50, 51, 52}, {100, 101, 102}});
  std::vector<int64_t> groups;
  for (const SimilarPose& pose : similar_poses(take_, 0, take_, {}, 10)) {
    groups.push_back(pose.pulse / 50);
  }
  EXPECT_THAT(groups, testing::UnorderedElementsAre(1, 2));
}

TEST_F(SimilarPoses, need_a_pulse_whose_mesh_has_a_surface) {
  codec::MotionSegment segment;
  segment.pulses = {0};
  segment.positions.resize(1);
  codec::MotionWriter writer({});
  const auto encoded = writer.add(segment);
  ASSERT_TRUE(encoded);
  const std::vector<uint8_t> header = codec::MotionWriter::header();
  std::string bytes(header.begin(), header.end());
  bytes.append(encoded->bytes.begin(), encoded->bytes.end());
  test::write_text(take::TakePaths{take_}.motion(), bytes);
  EXPECT_EQ(test::message_of<InputError>([&] { similar_poses(take_, 0, take_, {}, 10); }),
            take_.string() + ": the mesh of pulse 0 is empty; choose another pulse");
}

/// joints.json with the joints of `skeleton`, higher by 30 mm; `swap`: left and right exchanged.
std::string true_joints(const TakeSkeleton& skeleton, bool swap) {
  nlohmann::json joints = nlohmann::json::array(), pulses = nlohmann::json::array();
  for (size_t j = 0; j < recon::kBodyJoints; ++j) {
    std::string name(recon::name(static_cast<recon::Joint>(j)));
    if (swap && name.starts_with("left")) {
      name.replace(0, 4, "right");
    } else if (swap && name.starts_with("right")) {
      name.replace(0, 5, "left");
    }
    joints.push_back({{"name", "node"}, {"parent", -1}, {"main", name}});
  }
  for (const recon::SkeletonPulse& pulse : skeleton.structure.pulses) {
    nlohmann::json positions = nlohmann::json::array();
    for (size_t j = 0; j < recon::kBodyJoints; ++j) {
      const Eigen::Vector3d& p = pulse.joints[j];
      positions.push_back({p.x(), p.y(), p.z() + 0.03});
    }
    pulses.push_back({{"pulse", skeleton.pulses[pulse.index]}, {"positions", positions}});
  }
  return nlohmann::json{{"joints", joints}, {"pulses", pulses}}.dump();
}

class SkeletonTruth : public testing::Test {
 protected:
  std::string rejection(const std::string& text, int performer = 1) {
    test::write_text(folder_ / "joints.json", text);
    return test::message_of<InputError>(
        [&] { compare_with_truth(skeleton_, folder_.path(), performer); });
  }
  test::TemporaryFolder folder_;
  const TakeSkeleton skeleton_ = turning(4);
};

TEST_F(SkeletonTruth, is_compared_joint_by_joint) {
  test::write_text(folder_ / "joints.json", true_joints(skeleton_, false));
  const SkeletonError error = compare_with_truth(skeleton_, folder_.path(), 1);
  EXPECT_EQ(error.pulses, 4);
  EXPECT_EQ(error.swaps, 0);
  EXPECT_NEAR(error.all.p50_mm, 30, 1e-6);
  EXPECT_NEAR(error.of_joint.at("left_knee").p90_mm, 30, 1e-6);
  EXPECT_EQ(error.of_joint.size(), 15U);
}

TEST_F(SkeletonTruth, counts_pulses_with_left_and_right_exchanged) {
  test::write_text(folder_ / "joints.json", true_joints(skeleton_, true));
  EXPECT_EQ(compare_with_truth(skeleton_, folder_.path(), 1).swaps, 4);
}

TEST_F(SkeletonTruth, is_rejected_when_it_does_not_fit) {
  const std::string whole = true_joints(skeleton_, false);
  EXPECT_THAT(rejection("{}"), HasSubstr("joints.json: is no joints.json"));
  EXPECT_THAT(rejection(whole.substr(0, 100)), HasSubstr("is no joints.json"));
  EXPECT_THAT(rejection(whole, 2), HasSubstr("has no main joint of performer 2"));
  EXPECT_THAT(rejection(true_joints(turning(0), false)), HasSubstr("has no pulse with a skeleton"));
  nlohmann::json few = nlohmann::json::parse(whole);
  few["pulses"][0]["positions"].erase(3);
  EXPECT_THAT(rejection(few.dump()), HasSubstr("fewer positions than there are joints"));
}

TEST(BoneLengthSpread, is_the_largest_relative_change_of_a_bone) {
  TakeSkeleton skeleton = turning(3);
  EXPECT_LT(bone_length_spread(skeleton), 1e-9);
  recon::JointPositions& joints = skeleton.structure.pulses[1].joints;
  joints[recon::kHead] = joints[recon::kNeck] + 1.1 * (joints[recon::kHead] - joints[recon::kNeck]);
  EXPECT_NEAR(bone_length_spread(skeleton), 0.1, 1e-6);
}

}  // namespace
}  // namespace v3d::ctl
