#include "v3dctl/edit/editor.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <nlohmann/json.hpp>
#include <utility>
#include <vector>

#include "base/core/error.h"
#include "base/io/file.h"
#include "support/message_of.h"
#include "support/temporary_folder.h"
#include "tools/gliding_take.h"
#include "tools/turning_skeleton.h"

namespace v3d::ctl {
namespace {

using testing::HasSubstr;
namespace fs = std::filesystem;

TakeClip read(const fs::path& take) {
  return read_clip(
      take, [](int64_t) {}, [] {});
}

TEST(ClipOfSegments, interpolates_lost_pulses_by_the_skeletons_of_the_segment) {
  TakeSkeleton skeleton = test::with_a_shared_pulse();
  skeleton.tracked[0].pulses = {10, 11, 13};
  skeleton.tracked[1].pulses = {13, 14, 15};
  const std::vector<recon::SkeletonPulse> poses = skeleton.skins[0].poses;
  const recon::Clip clip = clip_of(std::move(skeleton));
  ASSERT_EQ(clip.frames.size(), 6U);
  const recon::SkeletonPulse expected = recon::blended(poses[1], poses[2], 0.5);
  EXPECT_TRUE(clip.frames[2].skeleton.rotations[recon::kLeftElbow].isApprox(
      expected.rotations[recon::kLeftElbow], 1e-6));
}

constexpr double kPropM = 0.93;

/// Gives the performer a prop in the right hand that points forward.
void add_prop(TakeClip& clip) {
  clip.has_prop = true;
  clip.lengths.bones().back().metres = kPropM;
  clip.clip.surfaces[0].skin.influences[0].part[0] = recon::kPropBase;
  for (recon::ClipFrame& frame : clip.clip.frames) {
    recon::SkeletonPulse& skeleton = frame.skeleton;
    const Eigen::Matrix3d& wrist = skeleton.rotations[recon::kRightWrist];
    skeleton.rotations[recon::kPropBase] = skeleton.rotations[recon::kPropTip] = wrist;
    skeleton.joints[recon::kPropBase] = skeleton.joints[recon::kRightWrist];
    skeleton.joints[recon::kPropTip] =
        skeleton.joints[recon::kPropBase] + wrist * Eigen::Vector3d(kPropM, 0, 0);
    skeleton.confidence[recon::kPropBase] = skeleton.confidence[recon::kPropTip] = 1;
  }
}

/// Has the prop its position in a hand?
void expect_prop_in_hand(const recon::SkeletonPulse& skeleton, recon::Joint wrist) {
  const Eigen::Vector3d expected =
      skeleton.joints[wrist] + skeleton.rotations[wrist] * Eigen::Vector3d(kPropM, 0, 0);
  EXPECT_LT((skeleton.joints[recon::kPropTip] - expected).norm(), 1e-4);
}

/// Has the prop of every frame its position in the right hand?
void expect_prop_in_hand(const recon::Clip& clip) {
  for (const recon::ClipFrame& frame : clip.frames) {
    expect_prop_in_hand(frame.skeleton, recon::kRightWrist);
  }
}

/// An action, and a second take for splices.
class EditorTest : public testing::Test {
 protected:
  EditorTest() { test::write_gliding_take(folder_ / "take"); }

  std::string rejection(const Edit& edit) {
    return test::message_of<InputError>([&] { editor_.apply(edit); });
  }

  const test::TemporaryFolder folder_;
  const Edit splice_{"edit.json: operations[0]",
                     SpliceEdit{.take = folder_ / "other", .at = {}, .from = {}, .blend = 2}};
  TakeClip edited_;
  Editor editor_{edited_, read};
};

TEST_F(EditorTest, splices_only_takes_of_one_pulse_rate) {
  edited_ = read(folder_ / "take");
  test::write_gliding_take(folder_ / "other", 50);
  EXPECT_EQ(rejection(splice_), "edit.json: operations[0].take: " + (folder_ / "other").string() +
                                    " has 50 pulses a second, the action 25; expected the same");
  EXPECT_EQ(edited_.clip.frames.size(), size_t{test::kGlidingPulses});
  fs::remove_all(folder_ / "other");
  test::write_gliding_take(folder_ / "other", 25.0001);
  editor_.apply(splice_);
  EXPECT_EQ(editor_.splices().size(), 1U);
}

TEST_F(EditorTest, reports_the_last_frame_before_the_surface_changes_also_after_later_operations) {
  edited_ = read(folder_ / "take");
  test::write_gliding_take(folder_ / "other");
  const auto splice = [&](int64_t at) {
    editor_.apply(Edit{"edit.json: operations[0]", SpliceEdit{.take = folder_ / "other",
                                                              .at = EditRange{at, at + 1},
                                                              .from = EditRange{0, 1},
                                                              .blend = 2}});
  };
  const auto expect_change = [&](int64_t frame) {
    ASSERT_EQ(editor_.splices().size(), 1U);
    EXPECT_EQ(editor_.splices()[0].frame, frame);
    const std::vector<recon::ClipFrame>& frames = edited_.clip.frames;
    for (size_t f = 1; f < frames.size(); ++f) {
      const bool changes = frames[f].surface != frames[f - 1].surface;
      EXPECT_EQ(changes, static_cast<int64_t>(f) == frame + 1) << f;
    }
  };
  splice(1);
  expect_change(2);
  EXPECT_EQ(editor_.splices()[0].next, 1);
  editor_.apply(Edit{"edit.json: operations[1]", CutEdit{{1, 8}}});
  expect_change(1);
  editor_.apply(Edit{"edit.json: operations[2]", StretchEdit{EditRange{0, 1}, 3}});
  expect_change(3);
  editor_.apply(Edit{"edit.json: operations[3]", StretchEdit{EditRange{6, 8}, 2}});
  expect_change(3);
  editor_.apply(Edit{"edit.json: operations[4]", StretchEdit{EditRange{2, 6}, 2}});
  expect_change(5);
  splice(1);
  expect_change(2);
  editor_.apply(Edit{"edit.json: operations[5]", CutEdit{{0, 3}}});
  EXPECT_TRUE(editor_.splices().empty());
}

TEST_F(EditorTest, rejects_an_action_that_would_be_too_long_before_it_makes_its_frames) {
  edited_.clip.surfaces.resize(1);
  edited_.clip.frames.resize(2001);
  const std::string message = rejection({"edit.json: operations[0]", StretchEdit{{}, 10}});
  EXPECT_EQ(message,
            "edit.json: operations[0]: the action would have 20,010 frames; expected at most "
            "20,000: cut it first");
  EXPECT_EQ(edited_.clip.frames.size(), 2001U);
}

TEST_F(EditorTest, bends_only_joints_that_move_the_surface) {
  edited_ = read(folder_ / "take");
  std::vector<recon::SkinInfluence>& influences = edited_.clip.surfaces[0].skin.influences;
  influences[1].part[0] = recon::kLeftElbow;
  influences[2].part[0] = recon::kRightElbow;
  const auto bend = [](recon::Joint joint) {
    return Edit{"edit.json: operations[0]", BendEdit{.frames = {}, .joint = joint, .degrees = 60}};
  };
  EXPECT_EQ(rejection(bend(recon::kLeftWrist)),
            "edit.json: operations[0].joint: left_wrist moves no part of the surface in these "
            "frames; expected a joint that does, as left_elbow");
  EXPECT_THAT(rejection(bend(recon::kPropTip)), HasSubstr("as right_elbow"));
  add_prop(edited_);
  EXPECT_THAT(rejection(bend(recon::kPropTip)), HasSubstr("as prop_base"));
  editor_.apply(bend(recon::kRightWrist));
  expect_prop_in_hand(edited_.clip);
}

TEST_F(EditorTest, keeps_the_prop_of_one_action_in_the_hand_when_it_splices_two) {
  for (const bool is_first : {true, false}) {
    edited_ = read(folder_ / "take");
    if (is_first) add_prop(edited_);
    Editor editor(edited_, [&](const fs::path&) {
      TakeClip added = read(folder_ / "take");
      if (!is_first) add_prop(added);
      return added;
    });
    editor.apply(splice_);
    expect_prop_in_hand(edited_.clip);
    const fs::path out = folder_ / "out";
    write_clip(edited_, folder_ / "take", "{}", out);
    const auto joints = nlohmann::json::parse(read_file(out / "skeleton.json")).at("joints");
    ASSERT_EQ(joints.size(), size_t{recon::kJoints}) << "the skins have weights of all";
    EXPECT_NEAR(joints[recon::kPropTip].at("bone_m").get<double>(), kPropM, 1e-4);
    const recon::SkeletonPulse& without =
        (is_first ? edited_.clip.frames.back() : edited_.clip.frames.front()).skeleton;
    EXPECT_EQ(without.confidence[recon::kPropTip], 0);
  }
}

TEST_F(EditorTest, shows_another_performer_with_its_prop_in_the_action) {
  edited_ = read(folder_ / "take");
  const recon::SkeletonPulse before = edited_.clip.frames[4].skeleton;
  Editor editor(edited_, [&](const fs::path&) {
    TakeClip other = read(folder_ / "take");
    add_prop(other);
    return other;
  });
  editor.apply(Edit{"edit.json: operations[0]", SwapEdit{.take = folder_ / "other", .frame = 2}});
  EXPECT_EQ(edited_.clip.frames.size(), size_t{test::kGlidingPulses});
  EXPECT_TRUE(edited_.has_prop);
  EXPECT_NEAR(edited_.lengths.bones().back().metres, kPropM, 1e-9);
  expect_prop_in_hand(edited_.clip);
  const Eigen::Vector3d moved =
      edited_.clip.frames[4].skeleton.joints[recon::kPelvis] - before.joints[recon::kPelvis];
  EXPECT_LT(moved.norm(), 0.02) << "the other performer has equal legs";
}

TEST_F(EditorTest, reports_no_splice_before_a_swap_which_gives_all_frames_one_surface) {
  edited_ = read(folder_ / "take");
  test::write_gliding_take(folder_ / "other");
  editor_.apply(splice_);
  ASSERT_EQ(editor_.splices().size(), 1U);
  editor_.apply(Edit{"edit.json: operations[1]", SwapEdit{.take = folder_ / "other", .frame = 0}});
  EXPECT_EQ(edited_.clip.surfaces.size(), 1U);
  EXPECT_TRUE(editor_.splices().empty());
  editor_.apply(splice_);
  EXPECT_EQ(editor_.splices().size(), 1U);
}

TEST_F(EditorTest, names_the_frame_that_the_take_of_a_swap_does_not_have) {
  edited_ = read(folder_ / "take");
  test::write_gliding_take(folder_ / "other");
  EXPECT_EQ(rejection({"edit.json: operations[0]",
                       SwapEdit{.take = folder_ / "other", .frame = test::kGlidingPulses}}),
            "edit.json: operations[0].frame: 6, but the action of " + (folder_ / "other").string() +
                " has 6");
}

TEST_F(EditorTest, names_the_field_and_the_take_that_does_not_have_the_frames_of_a_splice) {
  edited_ = read(folder_ / "take");
  const fs::path other = folder_ / "other";
  test::write_gliding_take(other);
  const auto message = [&](const OptionalRange& at, const OptionalRange& from) {
    return rejection({"edit.json: operations[1]",
                      SpliceEdit{.take = other, .at = at, .from = from, .blend = 2}});
  };
  const std::string where = "edit.json: operations[1]";
  const std::string of_other = "the action of " + other.string() + " has 6";
  EXPECT_EQ(message({}, EditRange{0, 7}), where + ".from: frames 0 to 7, but " + of_other);
  EXPECT_EQ(message(EditRange{0, 7}, {}), where + ".at: frames 0 to 7, but the action has 6");
  EXPECT_EQ(message({}, EditRange{4, 6}),
            where + ".from: a blend of 2 frames needs them behind frame 4, but " + of_other);
  EXPECT_EQ(message(EditRange{4, 6}, {}),
            where + ".at: a blend of 2 frames needs them behind frame 4, but the action has 6");
  EXPECT_EQ(rejection({where, CutEdit{{0, 7}}}),
            where + ".frames: frames 0 to 7, but the action has 6");
}

TEST_F(EditorTest, writes_the_left_hand_as_the_parent_of_the_prop_of_a_mirrored_action) {
  edited_ = read(folder_ / "take");
  add_prop(edited_);
  test::write_gliding_take(folder_ / "other");
  editor_.apply(Edit{"edit.json: operations[0]", MirrorEdit{}});
  editor_.apply(Edit{"edit.json: operations[1]", SpliceEdit{.take = folder_ / "other",
                                                            .at = {},
                                                            .from = EditRange{.first = 0, .end = 1},
                                                            .blend = 2}});
  expect_prop_in_hand(edited_.clip.frames.front().skeleton, recon::kLeftWrist);
  expect_prop_in_hand(edited_.clip.frames.back().skeleton, recon::kLeftWrist);
  const fs::path out = folder_ / "out";
  write_clip(edited_, folder_ / "take", "{}", out);
  const auto joints = nlohmann::json::parse(read_file(out / "skeleton.json")).at("joints");
  EXPECT_EQ(joints[recon::kPropBase].at("parent"), "left_wrist");
}

}  // namespace
}  // namespace v3d::ctl
