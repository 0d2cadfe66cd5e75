#include "recon/skeleton/tracked_skeleton.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numbers>

#include "base/core/statistics.h"
#include "recon/figures.h"
#include "recon/skeleton/pose_fit.h"

namespace v3d::recon {
namespace {

using Eigen::AngleAxisd;
using Eigen::Isometry3d;
using Eigen::Vector3d;
using Eigen::Vector3f;

constexpr int kPulses = 24;

/// A person of capsules whose elbows, shoulders, hips and knees turn by up to half a radian.
class MovingPerson {
 public:
  MovingPerson() : rest_(joints_at_rest()) {
    body_.surface = figures::surface(figures::person(60, 60), 0.02);
    for (const Vector3f& position : body_.surface.vertices) parts_.push_back(part_at(position));
  }

  JointPositions joints(int pulse) const {
    const PartMotion motion = motions(pulse);
    JointPositions joints = rest_;
    for (size_t j = 0; j < kBodyJoints; ++j) {
      const auto joint = static_cast<Joint>(j);
      joints[j] = motion[moves_part(joint) ? joint : parent_part(joint)] * rest_[j];
    }
    return joints;
  }

  /// The surface at pulses 0 to `pulses` - 1.
  TrackedBody body(int pulses) const {
    TrackedBody body = body_;
    for (int p = 0; p < pulses; ++p) {
      const PartMotion motion = motions(p);
      body.pulses.push_back(p);
      std::vector<Vector3f>& positions = body.positions.emplace_back();
      for (size_t v = 0; v < parts_.size(); ++v) {
        const Vector3d position = motion[parts_[v]] * body.surface.vertices[v].cast<double>();
        positions.push_back(position.cast<float>());
      }
    }
    body.surface.vertices = body.positions[0];
    return body;
  }

  Joint part(size_t vertex) const { return parts_[vertex]; }

  bool is_near_a_joint(size_t vertex) const {
    const Vector3d position = body_.surface.vertices[vertex].cast<double>();
    return std::ranges::any_of(rest_,
                               [&](const Vector3d& j) { return (j - position).norm() < 0.12; });
  }

  /// A structure whose joints are wrong by `error`, to both sides in turn.
  KinematicStructure structure(int pulses, const Vector3d& error = {0.03, 0.02, -0.02}) const {
    KinematicStructure structure;
    structure.lengths = BodyLengths(1.75, 0.5);
    structure.outline = body_outline(1.75);
    for (int p = 0; p < pulses; ++p) {
      SkeletonPulse& pulse = structure.pulses.emplace_back();
      pulse.index = static_cast<size_t>(p);
      pulse.joints = joints(p);
      for (Vector3d& joint : pulse.joints) joint += p % 2 == 0 ? error : -error;
    }
    return structure;
  }

 private:
  static JointPositions joints_at_rest() {
    JointPositions joints = standing_pose(BodyLengths(1.75, 0.5), {0, 0, 0.98}, 0);
    joints[kNeck] = {0, 0, 1.44};
    joints[kHead] = {0, 0, 1.63};
    const double angle = std::numbers::pi / 3;
    for (const double side : {1.0, -1.0}) {
      const bool left = side > 0;
      const Vector3d shoulder(0, side * 0.185, 1.40);
      const Vector3d along(0, side * std::sin(angle), -std::cos(angle));
      joints[left ? kLeftShoulder : kRightShoulder] = shoulder;
      joints[left ? kLeftElbow : kRightElbow] = shoulder + 0.29 * along;
      joints[left ? kLeftWrist : kRightWrist] = shoulder + 0.56 * along;
      joints[left ? kLeftHip : kRightHip] = {0, side * 0.09, 0.93};
      joints[left ? kLeftKnee : kRightKnee] = {0, side * 0.12, 0.50};
      joints[left ? kLeftAnkle : kRightAnkle] = {0, side * 0.13, 0.08};
    }
    return joints;
  }

  /// The capsules of figures::person(), in order.
  static Joint part_at(const Vector3f& position) {
    constexpr std::array kParts{kHead,       kHead,     kPelvis,    kPelvis,    kLeftShoulder,
                                kLeftElbow,  kLeftHip,  kLeftKnee,  kLeftAnkle, kRightShoulder,
                                kRightElbow, kRightHip, kRightKnee, kRightAnkle};
    const std::vector<figures::Capsule> capsules = figures::person(60, 60);
    size_t nearest = 0;
    double least = 1e9;
    for (size_t c = 0; c < capsules.size(); ++c) {
      const double outside =
          std::abs(figures::distance(capsules[c], position.cast<double>()) - capsules[c].radius);
      if (outside >= least) continue;
      least = outside;
      nearest = c;
    }
    const bool is_chest = kParts[nearest] == kPelvis && position.z() > 1.15F;
    return is_chest ? kNeck : kParts[nearest];
  }

  PartMotion motions(int pulse) const {
    const double phase = 2 * std::numbers::pi * pulse / kPulses;
    PartMotion motion;
    motion.fill(Isometry3d::Identity());
    motion[kPelvis].translation() = Vector3d(0.01 * pulse, 0, 0);
    const auto turn = [&](Joint joint, double angle, const Vector3d& axis) {
      Isometry3d about = Isometry3d::Identity();
      about.linear() = AngleAxisd(angle, axis).toRotationMatrix();
      about.translation() = rest_[joint] - about.linear() * rest_[joint];
      motion[joint] = motion[parent_part(joint)] * about;
    };
    motion[kNeck] = motion[kPelvis];
    motion[kHead] = motion[kNeck];
    for (const auto& [shoulder, elbow, hip, knee, ankle, sign] :
         {std::tuple{kLeftShoulder, kLeftElbow, kLeftHip, kLeftKnee, kLeftAnkle, 1.0},
          std::tuple{kRightShoulder, kRightElbow, kRightHip, kRightKnee, kRightAnkle, -1.0}}) {
      turn(shoulder, 0.4 * sign * std::sin(phase), Vector3d(0.3, 1, 0).normalized());
      turn(elbow, -0.3 - 0.3 * std::cos(phase), Vector3d::UnitY());
      turn(hip, 0.4 * sign * std::cos(phase), Vector3d(0.2, 1, 0).normalized());
      turn(knee, 0.3 + 0.3 * sign * std::sin(phase), Vector3d::UnitY());
      turn(ankle, 0.2 * std::sin(phase), Vector3d::UnitY());
    }
    return motion;
  }

  JointPositions rest_;
  TrackedBody body_;
  std::vector<Joint> parts_;
};

std::vector<int64_t> numbers(int pulses) {
  std::vector<int64_t> result;
  for (int p = 0; p < pulses; ++p) result.push_back(p);
  return result;
}

constexpr std::array kLimbJoints{kLeftShoulder, kLeftElbow, kRightShoulder, kRightElbow,
                                 kLeftHip,      kLeftKnee,  kRightHip,      kRightKnee};

TEST(RigidParts, are_those_that_move_rigidly_although_the_poses_are_wrong_by_4_cm) {
  const MovingPerson person;
  const TrackedBody body = person.body(kPulses);
  const KinematicStructure structure = person.structure(kPulses);
  std::vector<const JointPositions*> poses;
  for (const SkeletonPulse& pulse : structure.pulses) poses.push_back(&pulse.joints);
  const RigidParts parts = rigid_parts(body, poses, structure.outline, false);
  size_t right = 0, limbs = 0;
  for (size_t v = 0; v < parts.part_of.size(); ++v) {
    const bool is_limb = std::ranges::count(kLimbJoints, person.part(v)) > 0;
    if (!is_limb || person.is_near_a_joint(v)) continue;
    ++limbs;
    right += parts.part_of[v] == person.part(v) ? 1 : 0;
  }
  EXPECT_GT(limbs, 500U);
  EXPECT_GT(right, limbs * 97 / 100);
  for (const auto& residual : parts.residual_m) EXPECT_LT(residual[kLeftElbow], 0.006);
}

TEST(TrackedSkeleton, has_its_joints_where_parts_meet) {
  const MovingPerson person;
  const std::vector<TrackedBody> bodies{person.body(kPulses)};
  KinematicStructure structure = person.structure(kPulses);
  learn_from_tracked(bodies, numbers(kPulses), structure);
  ASSERT_EQ(structure.pulses.size(), size_t{kPulses});
  for (const SkeletonPulse& pulse : structure.pulses) {
    const JointPositions truth = person.joints(static_cast<int>(pulse.index));
    for (const Joint joint : kLimbJoints) {
      EXPECT_LT((pulse.joints[joint] - truth[joint]).norm(), 0.02)
          << name(joint) << " at pulse " << pulse.index;
    }
  }
}

TEST(TrackedSkeleton, keeps_the_poses_of_shoulders_and_hips_of_a_performer_who_stands_still) {
  const MovingPerson person;
  TrackedBody still = person.body(kPulses);
  for (auto& positions : still.positions) positions = still.positions[0];
  KinematicStructure structure = person.structure(kPulses, Vector3d::Zero());
  for (SkeletonPulse& pulse : structure.pulses) pulse.joints = person.joints(0);
  const JointPositions before = structure.pulses[0].joints;
  learn_from_tracked(std::vector{still}, numbers(kPulses), structure);
  for (const Joint joint : {kLeftShoulder, kRightShoulder, kLeftHip, kRightHip}) {
    EXPECT_LT((structure.pulses[5].joints[joint] - before[joint]).norm(), 0.03) << name(joint);
  }
}

TEST(TrackedSkeleton, has_the_same_bone_lengths_at_pulses_with_and_without_a_tracked_surface) {
  const MovingPerson person;
  KinematicStructure structure = person.structure(kPulses);
  learn_from_tracked(std::vector{person.body(kPulses / 2)}, numbers(kPulses), structure);
  ASSERT_EQ(structure.pulses.size(), size_t{kPulses});
  EXPECT_NEAR(structure.lengths.between(kLeftHip, kLeftKnee), 0.43, 0.01);
  for (const SkeletonPulse& pulse : structure.pulses) {
    for (size_t j = 1; j < kBodyJoints; ++j) {
      const auto joint = static_cast<Joint>(j);
      EXPECT_NEAR((pulse.joints[joint] - pulse.joints[parent(joint)]).norm(),
                  structure.lengths.between(parent(joint), joint), 1e-6);
    }
  }
}

TEST(TrackedSkeleton, is_known_at_a_tracked_pulse_whose_own_mesh_shows_no_body) {
  const MovingPerson person;
  KinematicStructure structure = person.structure(kPulses);
  structure.pulses.erase(structure.pulses.begin() + 7);
  learn_from_tracked(std::vector{person.body(kPulses)}, numbers(kPulses), structure);
  ASSERT_EQ(structure.pulses.size(), size_t{kPulses});
  EXPECT_LT((structure.pulses[7].joints[kLeftKnee] - person.joints(7)[kLeftKnee]).norm(), 0.025);
}

TEST(TrackedSkeleton, leaves_out_a_body_at_whose_pulses_no_pose_is_known) {
  const MovingPerson person;
  TrackedBody later = person.body(kPulses);
  for (int64_t& pulse : later.pulses) pulse += kPulses;
  KinematicStructure structure = person.structure(kPulses);
  const std::vector<Skin> skins =
      learn_from_tracked(std::vector{later}, numbers(2 * kPulses), structure);
  ASSERT_EQ(skins.size(), 1U);
  EXPECT_TRUE(skins[0].influences.empty());
  EXPECT_EQ(structure.pulses.size(), size_t{kPulses});
}

TEST(Skin, reproduces_the_tracked_surface) {
  const MovingPerson person;
  const std::vector<TrackedBody> bodies{person.body(kPulses)};
  KinematicStructure structure = person.structure(kPulses);
  const std::vector<Skin> skins = learn_from_tracked(bodies, numbers(kPulses), structure);
  std::vector<double> distances;
  for (int p = 0; p < kPulses; ++p) {
    const PartMotion motion = part_motion(skins[0].rest, structure.pulses[static_cast<size_t>(p)]);
    const std::vector<Vector3f> moved = skinned(skins[0], motion, bodies[0].surface.vertices);
    for (size_t v = 0; v < moved.size(); ++v) {
      distances.push_back((moved[v] - bodies[0].positions[static_cast<size_t>(p)][v]).norm());
    }
  }
  EXPECT_LT(percentile(distances, 0.5), 0.005);
  EXPECT_LT(percentile(distances, 0.9), 0.02);
}

/// A body from one pulse to another, at rest at the first.
TrackedBody segment_of(const TrackedBody& body, std::ptrdiff_t begin, std::ptrdiff_t end) {
  TrackedBody segment;
  segment.pulses.assign(body.pulses.begin() + begin, body.pulses.begin() + end);
  segment.positions.assign(body.positions.begin() + begin, body.positions.begin() + end);
  segment.surface = body.surface;
  segment.surface.vertices = segment.positions[0];
  return segment;
}

TEST(Skin, has_its_own_skeleton_at_a_pulse_that_two_bodies_share) {
  const MovingPerson person;
  const TrackedBody whole = person.body(kPulses);
  const std::vector<TrackedBody> bodies{segment_of(whole, 0, 9), segment_of(whole, 8, kPulses)};
  KinematicStructure structure = person.structure(kPulses);
  const std::vector<Skin> skins = learn_from_tracked(bodies, numbers(kPulses), structure);
  ASSERT_EQ(skins[0].poses.size(), 9U);
  ASSERT_EQ(skins[1].poses.size(), size_t{kPulses} - 8);
  EXPECT_EQ(skins[1].poses[0].joints, structure.pulses[8].joints);
  const auto median_error = [&](const SkeletonPulse& pose) {
    const PartMotion motion = part_motion(skins[0].rest, pose);
    const std::vector<Vector3f> moved = skinned(skins[0], motion, bodies[0].surface.vertices);
    std::vector<double> distances;
    for (size_t v = 0; v < moved.size(); ++v) {
      distances.push_back((moved[v] - whole.positions[8][v]).norm());
    }
    return percentile(distances, 0.5);
  };
  EXPECT_LT(median_error(skins[0].poses[8]), 0.005);
  EXPECT_GT(median_error(structure.pulses[8]), median_error(skins[0].poses[8]));
}

TEST(Skin, has_weights_that_sum_to_one) {
  const MovingPerson person;
  KinematicStructure structure = person.structure(kPulses);
  const std::vector<Skin> skins =
      learn_from_tracked(std::vector{person.body(kPulses)}, numbers(kPulses), structure);
  for (const SkinInfluence& influence : skins[0].influences) {
    float sum = 0;
    for (const float weight : influence.weight) {
      EXPECT_GE(weight, 0);
      sum += weight;
    }
    EXPECT_NEAR(sum, 1, 1e-5);
  }
}

TEST(RestoredLengths, spread_an_error_over_a_limb_instead_of_moving_its_end) {
  const BodyLengths lengths(1.75, 0.5);
  const JointPositions standing = standing_pose(lengths, {0, 0, 1}, 0);
  JointPositions joints = standing;
  joints[kLeftElbow] += Vector3d(0, 0, -0.05);
  restore_lengths(lengths, joints);
  EXPECT_LT((joints[kLeftWrist] - standing[kLeftWrist]).norm(), 0.035);
}

}  // namespace
}  // namespace v3d::recon
