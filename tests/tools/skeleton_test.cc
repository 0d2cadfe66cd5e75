#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <csignal>
#include <cstdlib>
#include <nlohmann/json.hpp>
#include <stdexcept>
#include <string>
#include <vector>

#include "base/core/error.h"
#include "base/io/file.h"
#include "codec/motion_codec.h"
#include "common/console.h"
#include "recon/figures.h"
#include "support/message_of.h"
#include "support/temporary_folder.h"
#include "tools/glb.h"
#include "tools/gliding_take.h"
#include "tools/turning_skeleton.h"
#include "v3dctl/command_line.h"
#include "v3dctl/skeleton/take_skeleton.h"

namespace v3d::ctl {
namespace {

using test::turning;
using testing::AllOf;
using testing::HasSubstr;

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

TEST_F(LearntSkeleton, is_not_that_of_a_performer_whom_no_label_names) {
  write_labelled_meshes(folder_ / "take", 1);
  EXPECT_EQ(test::message_of<InputError>([&] { learn(2); }),
            "--performer 2: no pulse shows this performer; v3dctl performers " +
                (folder_ / "take").string() + " lists them");
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

TEST_F(LearntSkeleton, is_refused_before_the_graphs_where_its_surfaces_exceed_the_memory) {
  constexpr uint64_t kLimit = 1000;
  int pulses = 0;
  const auto learn_with_limit = [&] {
    return learn_skeleton(
        folder_ / "take", {}, 1, [](int64_t) {}, [&] { ++pulses; }, kLimit);
  };
  const std::string motion = take::TakePaths{folder_ / "take"}.motion();
  EXPECT_THAT(test::message_of<InputError>(learn_with_limit),
              AllOf(HasSubstr(motion + ": its surfaces at these pulses need "),
                    HasSubstr("more than the memory permits (")));
  EXPECT_EQ(pulses, 0);
  write_labelled_meshes(folder_ / "take", 2);
  EXPECT_THAT(learn_with_limit().tracked, testing::IsEmpty()) << "several performers";
  EXPECT_EQ(pulses, test::kGlidingPulses);
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
  const std::string numbers = glb.bytes_of(glb.indices());
  const std::string values = glb.bytes_of(glb.accessor(semantic));
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

TEST_F(SkeletonCommand, names_an_extension_once_for_the_textures_of_several_surfaces) {
  test::write_gliding_motion(take::TakePaths{folder_ / "take"}.motion(), {{0, 1, 2}, {2, 3, 4}});
  testing::internal::CaptureStderr();
  EXPECT_EQ(run({path("take"), "--export", "glb", path("take.glb"), "--atlas", "256"}), kExitDone);
  testing::internal::GetCapturedStderr();
  const nlohmann::json scene = test::parse_glb(read_file(path("take.glb"))).scene;
  EXPECT_EQ(scene.at("materials").size(), 2U);
  EXPECT_EQ(scene.at("extensionsUsed"), nlohmann::json::array({"KHR_materials_unlit"}));
}

TEST_F(SkeletonCommand, has_a_texture_only_as_glb) {
  testing::internal::CaptureStderr();
  EXPECT_EQ(run({path("take"), "--export", "bvh", path("take.bvh"), "--atlas", "256"}),
            kExitBadInput);
  EXPECT_THAT(testing::internal::GetCapturedStderr(), HasSubstr("--atlas: expected --export glb"));
  EXPECT_EQ(read_file(file_), "earlier");
}

TEST_F(SkeletonCommand, keeps_the_file_when_it_cannot_write_the_other_one) {
  const std::string longest = std::string(251, 'a') + ".bvh";  // none for the temporary file
  EXPECT_EQ(run({path("take"), "--export", "bvh", path(longest)}), kExitFailed);
  EXPECT_EQ(read_file(file_), "earlier");
}

TEST_F(SkeletonCommand, refuses_files_that_it_cannot_use_before_it_reads_the_meshes) {
  std::filesystem::remove(take::TakePaths{folder_ / "take"}.motion());  // there is no mesh
  const auto rejection = [&](const std::vector<std::string>& options) {
    std::vector<std::string> words{path("take")};
    words.insert(words.end(), options.begin(), options.end());
    testing::internal::CaptureStderr();
    EXPECT_EQ(run(words), kExitBadInput);
    return testing::internal::GetCapturedStderr();
  };
  const std::string absent = path("none/take.bvh");
  EXPECT_THAT(rejection({"--export", "bvh", absent}), HasSubstr("OUT " + absent + ": its folder"));
  EXPECT_THAT(rejection({"--export", "bvh", path("take/calib.toml")}),
              HasSubstr("is a recorded file of a take"));
  EXPECT_THAT(rejection({"--export", "glb", path("take.glb")}), HasSubstr("glb needs a tracked"));
  EXPECT_THAT(rejection({"--truth", path("none")}), HasSubstr(path("none/joints.json")));
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
  const SimilarPoseList found = similar_poses(take_, 0, take_, {}, 10);
  EXPECT_TRUE(found.unfinished.empty());
  for (const SimilarPose& pose : found.poses) {
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
