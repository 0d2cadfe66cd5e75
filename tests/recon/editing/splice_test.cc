#include "recon/editing/splice.h"

#include <gtest/gtest.h>

#include <cmath>
#include <stdexcept>

#include "recon/editing/clips.h"
#include "recon/editing/feet.h"

namespace v3d::recon {
namespace {

using Eigen::Vector3d;

/// A person who glides ahead: the left knee and the right arm turn with the sine of the frame.
Clip stepping(size_t frames, size_t phase, const Vector3d& pelvis, double yaw) {
  const Vector3d step(0.01 * std::cos(yaw), 0.01 * std::sin(yaw), 0);
  Clip clip = clips::gliding(frames, pelvis, step, yaw);
  for (size_t f = 0; f < frames; ++f) {
    const double angle = 0.5 + 0.5 * std::sin(0.3 * static_cast<double>(f + phase));
    bend(clip, {.joint = kLeftKnee, .range = {f, f + 1}, .radians = angle});
    bend(clip, {.joint = kRightShoulder, .range = {f, f + 1}, .radians = -angle});
  }
  return clip;
}

TEST(SpliceTransition, is_found_where_the_poses_are_alike_wherever_the_performers_stand) {
  const Clip a = stepping(20, 0, {0, 0, 0.95}, 0.2);
  const Clip b = stepping(30, 4, {2, -1, 0.95}, 1.9);
  const SpliceTransition found = best_transition(a, {10, 11}, b, {0, 15}, 3, [] {});
  // Frames 11 to 13 of the first action are frames 7 to 9 of the second one.
  EXPECT_EQ(found.at, 10U);
  EXPECT_EQ(found.from, 7U);
  EXPECT_LT(found.cost_m, 1e-6);
}

TEST(SpliceTransition, costs_more_between_different_poses) {
  const Clip a = stepping(20, 0, {0, 0, 0.95}, 0);
  const Clip b = stepping(20, 0, {0, 0, 0.95}, 0);
  const double same = best_transition(a, {5, 6}, b, {6, 7}, 3, [] {}).cost_m;
  const double other = best_transition(a, {5, 6}, b, {14, 15}, 3, [] {}).cost_m;
  EXPECT_LT(same, 1e-9);
  EXPECT_GT(other, 0.05);
}

TEST(SpliceTransition, is_not_searched_for_after_the_caller_stops_it) {
  const Clip clip = stepping(20, 0, {0, 0, 0.95}, 0);
  int frames = 0;
  const auto stop_at_third = [&] {
    if (++frames == 3) throw std::runtime_error("interrupted");
  };
  EXPECT_THROW(best_transition(clip, {0, 20}, clip, {0, 20}, 3, stop_at_third), std::runtime_error);
  EXPECT_EQ(frames, 3);
}

TEST(Splice, continues_at_the_place_of_the_first_action_without_a_jump) {
  Clip a = stepping(20, 0, {0, 0, 0.95}, 0.2);
  const Clip b = stepping(30, 4, {2, -1, 0.95}, 1.9);
  const SpliceTransition found = best_transition(a, {10, 11}, b, {0, 15}, 4, [] {});
  EXPECT_EQ(splice(a, b, found), 12U);
  ASSERT_EQ(a.frames.size(), 11 + 30 - found.from);
  EXPECT_EQ(a.surfaces.size(), 2U);
  for (size_t f = 0; f + 1 < a.frames.size(); ++f) {
    for (size_t j = 0; j < kBodyJoints; ++j) {
      EXPECT_LT((a.frames[f + 1].skeleton.joints[j] - a.frames[f].skeleton.joints[j]).norm(), 0.1)
          << f;
    }
  }
  EXPECT_EQ(a.frames[10].surface, 0U);
  EXPECT_EQ(a.frames[11].surface, 0U);
  EXPECT_EQ(a.frames[14].surface, 1U);
  EXPECT_LT(relative_jump(a, 12, 5), 1.5);
}

/// A person who stands still, with the left leg in front and the right one behind.
Clip straddling(double radians) {
  Clip clip = clips::gliding(20, {0, 0, 0.95}, {0, 0, 0});
  bend(clip, {.joint = kLeftHip, .range = {0, 20}, .radians = -radians});
  bend(clip, {.joint = kRightHip, .range = {0, 20}, .radians = radians});
  return clip;
}

TEST(Splice, has_standing_feet_in_one_position_before_and_after_it_when_they_are_held) {
  Clip clip = straddling(0.436);
  splice(clip, straddling(0.47), {.at = 9, .from = 0, .blend = 8, .cost_m = 0});
  EXPECT_GT(foot_slide(clip, foot_contacts(clip)), 0.01);
  hold_all_feet(clip, 5, [] {});
  EXPECT_LT(foot_slide(clip, foot_contacts(clip)), 0.001);
  for (const Joint ankle : {kLeftAnkle, kRightAnkle}) {
    const Vector3d moved =
        clip.frames.back().skeleton.joints[ankle] - clip.frames.front().skeleton.joints[ankle];
    EXPECT_LT(moved.head<2>().norm(), 0.001) << name(ankle);
  }
}

TEST(Splice, has_a_large_relative_jump_where_the_poses_differ) {
  Clip a = stepping(20, 0, {0, 0, 0.95}, 0);
  const size_t last =
      splice(a, stepping(20, 0, {0, 0, 0.95}, 0), {.at = 5, .from = 14, .blend = 1, .cost_m = 0});
  EXPECT_GT(relative_jump(a, last, 5), 1.5);
}

}  // namespace
}  // namespace v3d::recon
