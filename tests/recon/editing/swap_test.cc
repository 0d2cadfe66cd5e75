#include <gtest/gtest.h>

#include "recon/editing/clip.h"
#include "recon/editing/clips.h"
#include "recon/skeleton/body_model.h"

namespace v3d::recon {
namespace {

using Eigen::Vector3d;

constexpr double kAdultM = 1.75, kChildM = 1.4;  ///< clips::standing() has the first one

/// A child who stands at (3, 1), and looks to the left.
Clip child() {
  SkeletonPulse skeleton;
  skeleton.joints = standing_pose(BodyLengths(kChildM, 0.4), {3, 1, 0.76}, 1.5);
  skeleton.rotations = joint_rotations(skeleton.joints);
  Clip clip;
  clip.surfaces.push_back(clips::surface(skeleton));
  clip.frames.push_back(clips::frame(skeleton));
  return clip;
}

/// An adult who glides along x, and bends the left knee and the right shoulder.
Clip gliding() {
  Clip clip = clips::gliding(8, {1, 0, 0.95}, {0.05, 0, 0});
  bend(clip, {.joint = kLeftKnee, .range = {2, 8}, .radians = 0.8});
  bend(clip, {.joint = kRightShoulder, .range = {0, 8}, .radians = -1});
  return clip;
}

TEST(SwappedPerformer, has_the_pose_of_the_action_and_its_own_bones) {
  const Clip before = gliding();
  const Clip other = child();
  Clip clip = before;
  swap_performer(clip, other, 0);
  ASSERT_EQ(clip.frames.size(), before.frames.size());
  for (size_t f = 0; f < clip.frames.size(); ++f) {
    const JointPositions& now = clip.frames[f].skeleton.joints;
    const JointPositions& then = before.frames[f].skeleton.joints;
    for (size_t j = 1; j < kBodyJoints; ++j) {
      const auto joint = static_cast<Joint>(j);
      const Vector3d bone = now[joint] - now[parent(joint)];
      const Vector3d expected = kChildM / kAdultM * (then[joint] - then[parent(joint)]);
      EXPECT_LT((bone - expected).norm(), 1e-6) << name(joint) << " " << f;
    }
  }
}

TEST(SwappedPerformer, has_its_own_surface_at_the_joints) {
  const Clip other = child();
  Clip clip = gliding();
  swap_performer(clip, other, 0);
  ASSERT_EQ(clip.surfaces.size(), 1U);
  for (const ClipFrame& frame : clip.frames) {
    EXPECT_EQ(frame.surface, 0U);
    for (size_t j = 0; j < kBodyJoints; ++j) {
      const Vector3d position = frame.positions[clips::kPerJoint * j].cast<double>();
      EXPECT_LT((position - frame.skeleton.joints[j]).norm(), 1e-4) << name(static_cast<Joint>(j));
    }
  }
}

TEST(SwappedPerformer, makes_steps_that_fit_the_legs_and_stands_on_the_floor) {
  const Clip before = gliding();
  Clip clip = before;
  swap_performer(clip, child(), 0);
  constexpr double kScale = kChildM / kAdultM;
  const auto pelvis = [](const Clip& of, size_t f) {
    return of.frames[f].skeleton.joints[kPelvis];
  };
  EXPECT_NEAR(pelvis(clip, 0).x(), 1, 1e-9);
  EXPECT_NEAR(pelvis(clip, 7).x() - pelvis(clip, 0).x(), kScale * 0.35, 1e-6);
  EXPECT_NEAR(clip.frames[0].skeleton.joints[kRightAnkle].z(),
              kScale * before.frames[0].skeleton.joints[kRightAnkle].z(), 1e-6);
}

TEST(SwappedPerformer, moves_nothing_when_it_is_the_same_one) {
  const Clip before = gliding();
  Clip clip = before;
  swap_performer(clip, before, 3);
  for (size_t f = 0; f < clip.frames.size(); ++f) {
    for (size_t v = 0; v < before.frames[f].positions.size(); ++v) {
      EXPECT_LT((clip.frames[f].positions[v] - before.frames[f].positions[v]).norm(), 1e-5F) << f;
    }
  }
}

TEST(SwappedPerformer, holds_its_own_prop_in_its_own_hand) {
  Clip other = child();
  mirror(other);
  const JointPositions held = other.frames[0].skeleton.joints;
  Clip clip = gliding();
  swap_performer(clip, other, 0);
  EXPECT_EQ(clip.prop_hand, kLeftWrist);
  for (const ClipFrame& frame : clip.frames) {
    const JointPositions& joints = frame.skeleton.joints;
    EXPECT_NEAR((joints[kPropTip] - joints[kLeftWrist]).norm(),
                (held[kPropTip] - held[kLeftWrist]).norm(), 1e-6);
  }
}

}  // namespace
}  // namespace v3d::recon
