#include "recon/editing/clip.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <numbers>
#include <utility>
#include <vector>

#include "recon/editing/clips.h"
#include "recon/editing/feet.h"

namespace v3d::recon {
namespace {

using Eigen::Vector3d;
using Eigen::Vector3f;

constexpr double kQuarter = std::numbers::pi / 2;

Clip gliding(size_t frames) { return clips::gliding(frames, {0, 0, 0.95}, {0.01, 0, 0}); }

/// Are the vertices of all joints still at their joints?
void expect_skin_at_joints(const Clip& clip) {
  for (const ClipFrame& frame : clip.frames) {
    for (size_t j = 0; j < kBodyJoints; ++j) {
      const Vector3d position = frame.positions[clips::kPerJoint * j].cast<double>();
      EXPECT_LT((position - frame.skeleton.joints[j]).norm(), 1e-4) << name(static_cast<Joint>(j));
    }
  }
}

TEST(Clip, keeps_only_the_frames_of_a_cut) {
  Clip clip = gliding(10);
  cut(clip, {3, 7});
  ASSERT_EQ(clip.frames.size(), 4U);
  EXPECT_NEAR(clip.frames[0].skeleton.joints[kPelvis].x(), 0.03, 1e-9);
}

TEST(Clip, lasts_longer_by_the_factor_and_moves_steadily_when_it_is_stretched) {
  Clip clip = gliding(11);
  stretch(clip, {0, 11}, 2);
  ASSERT_EQ(clip.frames.size(), 22U);
  for (size_t f = 0; f < 22; ++f) {
    EXPECT_NEAR(clip.frames[f].skeleton.joints[kPelvis].x(), 0.1 * static_cast<double>(f) / 21,
                1e-6);
  }
  expect_skin_at_joints(clip);
}

TEST(Clip, changes_its_surface_after_the_stretched_frame_when_it_is_stretched) {
  for (const double factor : {0.1, 0.5, 0.7, 1.0, 1.3, 2.0, 10.0}) {
    for (size_t last = 0; last < 10; ++last) {
      Clip clip = gliding(11);
      clip.surfaces.push_back(clip.surfaces[0]);
      for (size_t f = last + 1; f < 11; ++f) clip.frames[f].surface = 1;
      stretch(clip, {0, 11}, factor);
      ASSERT_EQ(clip.frames.size(), stretched_frames(11, factor));
      const size_t expected = stretched_frame(11, factor, last);
      for (size_t f = 0; f < clip.frames.size(); ++f) {
        EXPECT_EQ(clip.frames[f].surface, f <= expected ? 0U : 1U) << factor << " " << last;
      }
    }
  }
}

TEST(Clip, keeps_the_frames_outside_a_stretched_range) {
  Clip clip = gliding(10);
  stretch(clip, {2, 6}, 0.5);
  ASSERT_EQ(clip.frames.size(), 8U);
  EXPECT_NEAR(clip.frames[1].skeleton.joints[kPelvis].x(), 0.01, 1e-9);
  EXPECT_NEAR(clip.frames[4].skeleton.joints[kPelvis].x(), 0.06, 1e-9);
}

TEST(Clip, moves_the_surface_with_a_bent_joint_and_only_what_hangs_on_it) {
  Clip clip = gliding(5);
  const Clip before = clip;
  bend(clip, {.joint = kLeftElbow, .range = {1, 4}, .radians = -kQuarter});
  expect_skin_at_joints(clip);
  for (size_t f = 0; f < 5; ++f) {
    const JointPositions& now = clip.frames[f].skeleton.joints;
    const JointPositions& then = before.frames[f].skeleton.joints;
    const bool is_bent = f >= 1 && f < 4;
    EXPECT_EQ((now[kLeftWrist] - then[kLeftWrist]).norm() > 0.2, is_bent) << f;
    EXPECT_LT((now[kLeftElbow] - then[kLeftElbow]).norm(), 1e-9);
    EXPECT_LT((now[kRightWrist] - then[kRightWrist]).norm(), 1e-9);
  }
  // A negative turn about the axis to the left raises a hanging forearm to the front.
  EXPECT_GT(clip.frames[2].skeleton.joints[kLeftWrist].x(),
            clip.frames[2].skeleton.joints[kLeftElbow].x() + 0.2);
}

TEST(Clip, has_joints_that_move_no_vertex_because_no_part_hangs_on_them) {
  const Clip clip = gliding(3);
  for (size_t j = 0; j < kJoints; ++j) {
    const auto joint = static_cast<Joint>(j);
    const bool has_part = moves_part(joint) && joint != kPropBase;  // the figure has no prop
    EXPECT_EQ(moves_surface(clip, joint, {0, 3}), has_part) << name(joint);
  }
}

TEST(Clip, moves_a_prop_only_in_frames_whose_surface_has_it) {
  Clip clip = gliding(3);
  clip.surfaces.push_back(clip.surfaces[0]);
  clip.surfaces[1].skin.influences[0].part.fill(kPropBase);
  clip.frames[2].surface = 1;
  for (const Joint joint : {kRightWrist, kPropBase}) {
    EXPECT_FALSE(moves_surface(clip, joint, {0, 2})) << name(joint);
    EXPECT_TRUE(moves_surface(clip, joint, {1, 3})) << name(joint);
  }
}

TEST(Clip, bends_more_and_more_within_a_ramp) {
  Clip clip = gliding(9);
  bend(clip, {.joint = kLeftKnee, .range = {0, 9}, .radians = 1, .ramp = 3});
  const auto angle = [&](size_t f) {
    const JointPositions& joints = clip.frames[f].skeleton.joints;
    const Vector3d thigh = joints[kLeftHip] - joints[kLeftKnee];
    const Vector3d shin = joints[kLeftKnee] - joints[kLeftAnkle];
    return std::acos(thigh.normalized().dot(shin.normalized()));
  };
  for (size_t f = 0; f < 4; ++f) EXPECT_LT(angle(f), angle(f + 1) + (f == 3 ? 1e-6 : 0)) << f;
  EXPECT_NEAR(angle(0), angle(8), 1e-6);
}

TEST(Clip, has_the_left_arm_where_the_right_one_was_when_it_is_mirrored) {
  Clip clip = gliding(5);
  bend(clip, {.joint = kLeftShoulder, .range = {0, 5}, .radians = -kQuarter});
  const Clip before = clip;
  mirror(clip);
  bend(clip, {.joint = kRightElbow, .range = {0, 1}, .radians = 0.5});
  for (size_t f = 0; f < 5; ++f) {
    const Vector3d left = before.frames[f].skeleton.joints[kLeftWrist];
    const Vector3d right = clip.frames[f].skeleton.joints[kRightWrist];
    const double moved = (right - Vector3d(left.x(), -left.y(), left.z())).norm();
    EXPECT_EQ(moved > 1e-6, f == 0);
    // What was the surface of the left wrist follows the right one, also when that is bent again.
    const Vector3d surface = clip.frames[f].positions[clips::kPerJoint * kLeftWrist].cast<double>();
    EXPECT_LT((surface - right).norm(), 1e-5);
    for (const Eigen::Matrix3d& rotation : clip.frames[f].skeleton.rotations) {
      EXPECT_NEAR(rotation.determinant(), 1, 1e-6);
    }
  }
}

TEST(Clip, has_its_triangles_outside_out_when_it_is_mirrored) {
  const auto volume = [](const Clip& clip) {
    return enclosed_volume({.vertices = clip.frames[0].positions,
                            .triangles = clip.surfaces[0].triangles,
                            .colours = {}});
  };
  Clip clip = gliding(1);
  const double before = volume(clip);
  mirror(clip);
  EXPECT_NEAR(volume(clip), before, 1e-3 * std::abs(before));
}

TEST(Clip, is_the_same_after_two_reflections) {
  Clip clip = gliding(3);
  const Clip before = clip;
  mirror(clip);
  mirror(clip);
  for (size_t v = 0; v < before.frames[1].positions.size(); ++v) {
    EXPECT_LT((clip.frames[1].positions[v] - before.frames[1].positions[v]).norm(), 1e-5F);
  }
  EXPECT_EQ(clip.surfaces[0].triangles, before.surfaces[0].triangles);
}

/// Distance of the base of the prop from a wrist, in each frame.
std::vector<double> prop_distances(const Clip& clip, Joint wrist) {
  std::vector<double> metres;
  for (const ClipFrame& frame : clip.frames) {
    const JointPositions& joints = frame.skeleton.joints;
    metres.push_back((joints[kPropBase] - joints[wrist]).norm());
  }
  return metres;
}

TEST(Clip, has_the_prop_in_the_left_hand_when_it_is_mirrored) {
  Clip clip = gliding(3);
  const double in_hand = prop_distances(clip, kRightWrist)[0];
  mirror(clip);
  bend(clip, {.joint = kLeftElbow, .range = {0, 3}, .radians = -kQuarter});
  for (const double metres : prop_distances(clip, kLeftWrist)) EXPECT_NEAR(metres, in_hand, 1e-6);
  const Vector3d tip = clip.frames[0].skeleton.joints[kPropTip];
  bend(clip, {.joint = kRightElbow, .range = {0, 3}, .radians = -kQuarter});
  EXPECT_LT((clip.frames[0].skeleton.joints[kPropTip] - tip).norm(), 1e-9);
  mirror(clip);
  bend(clip, {.joint = kRightShoulder, .range = {0, 3}, .radians = -kQuarter});
  for (const double metres : prop_distances(clip, kRightWrist)) EXPECT_NEAR(metres, in_hand, 1e-6);
}

TEST(Clip, bends_the_wrist_that_holds_the_prop_also_when_it_is_mirrored) {
  Clip clip = gliding(3);
  clip.surfaces[0].skin.influences[0].part.fill(kPropBase);
  mirror(clip);
  EXPECT_TRUE(moves_surface(clip, kLeftWrist, {0, 3}));
  EXPECT_FALSE(moves_surface(clip, kRightWrist, {0, 3}));
}

TEST(Clip, carries_the_prop_of_another_clip_in_the_hand_that_holds_it_there) {
  Clip held = gliding(1);
  mirror(held);
  Clip clip = clips::gliding(3, {1, 2, 0.95}, {0.01, 0, 0}, 0.8);
  carry_prop(clip, held.frames[0].skeleton, held.prop_hand);
  EXPECT_EQ(clip.prop_hand, kLeftWrist);
  const double in_hand = prop_distances(held, kLeftWrist)[0];
  for (const double metres : prop_distances(clip, kLeftWrist)) EXPECT_NEAR(metres, in_hand, 1e-6);
}

TEST(Feet, stand_in_contacts_and_not_while_they_move_fast) {
  EXPECT_EQ(foot_contacts(clips::gliding(10, {0, 0, 0.95}, {0.005, 0, 0})).size(), 2U);
  EXPECT_TRUE(foot_contacts(clips::gliding(10, {0, 0, 0.95}, {0.05, 0, 0})).empty());
}

TEST(Feet, stay_where_they_stand_when_they_are_held) {
  Clip clip = clips::gliding(16, {0, 0, 0.90}, {0.005, 0, 0});
  const std::vector<FootContact> contacts = foot_contacts(clip);
  EXPECT_GT(foot_slide(clip, contacts), 0.03);
  hold_feet(clip, contacts, 4);
  EXPECT_LT(foot_slide(clip, contacts), 1e-4);
  for (const ClipFrame& frame : clip.frames) {
    EXPECT_NEAR((frame.skeleton.joints[kLeftHip] - frame.skeleton.joints[kLeftKnee]).norm(),
                0.2425 * 1.75, 2e-3);
  }
}

/// A person with the legs apart, the left one in front, both nearly straight, who glides ahead.
Clip straddling(size_t frames, double radians, const Vector3d& step) {
  Clip clip = clips::gliding(frames, {0, 0, 0.95}, step);
  bend(clip, {.joint = kLeftHip, .range = {0, frames}, .radians = -radians});
  bend(clip, {.joint = kRightHip, .range = {0, frames}, .radians = radians});
  return clip;
}

/// Largest distance by which an ankle is higher or lower than in `before`.
double height_change(const Clip& clip, const Clip& before) {
  double largest = 0;
  for (size_t f = 0; f < clip.frames.size(); ++f) {
    for (const Joint ankle : {kLeftAnkle, kRightAnkle}) {
      const double now = clip.frames[f].skeleton.joints[ankle].z();
      largest = std::max(largest, std::abs(now - before.frames[f].skeleton.joints[ankle].z()));
    }
  }
  return largest;
}

TEST(Feet, stay_on_the_floor_out_of_reach_of_straight_legs_because_the_pelvis_moves) {
  Clip clip = straddling(16, 0.45, {0.005, 0, 0});
  const Clip before = clip;
  const std::vector<FootContact> contacts = foot_contacts(clip);
  ASSERT_EQ(contacts.size(), 2U);
  EXPECT_GT(foot_slide(clip, contacts), 0.03);
  hold_feet(clip, contacts, 4);
  EXPECT_LT(foot_slide(clip, contacts), 1e-4);
  EXPECT_LT(height_change(clip, before), 1e-4);
  EXPECT_LT(clip.frames[0].skeleton.joints[kPelvis].z(), 0.945);
  for (const ClipFrame& frame : clip.frames) {
    EXPECT_NEAR((frame.skeleton.joints[kLeftHip] - frame.skeleton.joints[kLeftKnee]).norm(),
                0.2425 * 1.75, 2e-3);
  }
}

TEST(Feet, leave_the_pelvis_where_it_is_while_bent_legs_reach_them) {
  Clip clip = clips::gliding(16, {0, 0, 0.95}, {0.005, 0, 0});
  for (const auto& [hip, knee] :
       {std::pair{kLeftHip, kLeftKnee}, std::pair{kRightHip, kRightKnee}}) {
    bend(clip, {.joint = hip, .range = {0, 16}, .radians = -0.5});
    bend(clip, {.joint = knee, .range = {0, 16}, .radians = 1});
  }
  const Clip before = clip;
  const std::vector<FootContact> contacts = foot_contacts(clip);
  hold_feet(clip, contacts, 4);
  EXPECT_LT(foot_slide(clip, contacts), 1e-4);
  for (size_t f = 0; f < 16; ++f) {
    const Vector3d& pelvis = before.frames[f].skeleton.joints[kPelvis];
    EXPECT_LT((clip.frames[f].skeleton.joints[kPelvis] - pelvis).norm(), 1e-9);
  }
}

TEST(Feet, move_the_pelvis_smoothly_where_only_some_frames_need_it) {
  Clip clip = straddling(30, 0.45, {0, 0, 0});
  // The left foot slides back by 7 mm in each of eight frames.
  for (size_t f = 10; f < 18; ++f) {
    bend(clip, {.joint = kLeftHip, .range = {f, 30}, .radians = 0.010});
  }
  hold_feet(clip, foot_contacts(clip), 6);
  const auto pelvis = [&](size_t f) { return clip.frames[f].skeleton.joints[kPelvis]; };
  EXPECT_GT((pelvis(0) - pelvis(29)).norm(), 0.008);
  for (size_t f = 1; f + 1 < 30; ++f) {
    EXPECT_LT((pelvis(f + 1) - 2 * pelvis(f) + pelvis(f - 1)).norm(), 0.002) << f;
  }
}

/// A person who sways along x by a random walk, the same at each call.
Clip swaying(size_t frames) {
  Clip clip;
  clip.surfaces.push_back(clips::surface(clips::standing({0, 0, 0.95}, 0)));
  uint32_t state = 1374;
  double step = 0, x = 0;
  for (size_t f = 0; f < frames; ++f) {
    clip.frames.push_back(clips::frame(clips::standing({x, 0, 0.95}, 0)));
    state = state * 1664525U + 1013904223U;
    step = 0.8 * step + 0.001 * (static_cast<double>((state >> 16) % 25) - 12);
    x += step;
  }
  return clip;
}

TEST(Feet, are_held_again_until_none_slides_because_held_feet_stand_for_longer) {
  Clip clip = swaying(30);
  size_t passes = 0;
  hold_all_feet(clip, 5, [&] { ++passes; });
  EXPECT_LT(foot_slide(clip, foot_contacts(clip)), 0.001);
  EXPECT_GT(passes, 4U);
}

TEST(Feet, are_not_held_where_none_slides) {
  Clip clip = clips::gliding(10, {0, 0, 0.95}, {0, 0, 0});
  hold_all_feet(clip, 5, [] { ADD_FAILURE() << "a pass"; });
}

TEST(Feet, keep_their_height_when_they_are_held_also_before_and_after_they_stand) {
  Clip clip = clips::gliding(16, {0, 0, 0.95}, {0, 0, 0});
  const double leg =
      clip.frames[0].skeleton.joints[kLeftHip].z() - clip.frames[0].skeleton.joints[kLeftAnkle].z();
  // The left foot stands, raises its heel in frame 9, and leaves the floor: the knee is bent.
  for (size_t f = 9; f < 16; ++f) {
    const double height = f == 9 ? 0.03 : f == 10 ? 0.12 : 0.20;
    const double angle = std::acos(1 - height / leg);
    bend(clip, {.joint = kLeftHip, .range = {f, f + 1}, .radians = -angle});
    bend(clip, {.joint = kLeftKnee, .range = {f, f + 1}, .radians = 2 * angle});
  }
  const Clip before = clip;
  ASSERT_EQ(foot_contacts(clip).at(0).range.last, 10U);
  for (int pass = 0; pass < 4; ++pass) hold_feet(clip, foot_contacts(clip), 5);
  for (size_t f = 0; f < 16; ++f) {
    EXPECT_NEAR(clip.frames[f].skeleton.joints[kLeftAnkle].z(),
                before.frames[f].skeleton.joints[kLeftAnkle].z(), 0.001)
        << f;
  }
}

}  // namespace
}  // namespace v3d::recon
