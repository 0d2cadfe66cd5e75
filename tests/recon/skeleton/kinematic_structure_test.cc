#include "recon/skeleton/kinematic_structure.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <vector>

#include "recon/figures.h"
#include "recon/shapes.h"

namespace v3d::recon {
namespace {

BodyEvidence evidence_of(const Mesh& mesh) { return body_evidence(mesh, reeb_graph(mesh)); }

/// A person who swings the arms, and moves along x by 1 cm a pulse.
std::vector<BodyEvidence> swinging(int pulses) {
  std::vector<BodyEvidence> evidence;
  for (int p = 0; p < pulses; ++p) {
    evidence.push_back(evidence_of(
        figures::surface(figures::person(50 + 4 * p, 70 - 2 * p, {0.01 * p, 0, 0}), 0.02)));
  }
  return evidence;
}

TEST(BodyEvidence, names_the_ends_of_a_person_with_free_arms) {
  const BodyEvidence evidence = evidence_of(figures::surface(figures::person(70, 50)));
  EXPECT_EQ(evidence.problem, "");
  ASSERT_TRUE(evidence.head);
  EXPECT_NEAR(evidence.head->z(), 1.63, 0.06);
  EXPECT_EQ(evidence.feet.size(), 2U);
  EXPECT_EQ(evidence.hands.size(), 2U);
  EXPECT_FALSE(evidence.prop);
}

TEST(BodyEvidence, shows_where_the_toes_of_a_standing_person_are) {
  const BodyEvidence evidence = evidence_of(figures::surface(figures::person(70, 50)));
  ASSERT_EQ(evidence.feet.size(), 2U);
  for (const FootEvidence& foot : evidence.feet) {
    EXPECT_TRUE(foot.points_ahead);
    EXPECT_GT(foot.axis.x(), 0.9);
  }
}

TEST(BodyEvidence, reports_a_second_body) {
  Mesh two = figures::surface(figures::person(70, 50), 0.025);
  EXPECT_FALSE(evidence_of(two).has_other_bodies);
  shapes::append(two, figures::surface(figures::person(20, 50, {3, 0, 0}), 0.025));
  EXPECT_TRUE(evidence_of(two).has_other_bodies);
}

TEST(BodyEvidence, says_why_a_mesh_shows_no_body) {
  EXPECT_EQ(evidence_of({}).problem, "the mesh is empty");
  EXPECT_EQ(evidence_of(shapes::sphere({0, 0, 0}, 0.1F, 12)).problem,
            "the mesh is lower than a body");
  const Mesh stick = figures::surface({{{-0.5, 0, 1}, {0.5, 0, 1}, 0.03}});
  EXPECT_EQ(evidence_of(stick).problem, "the mesh is lower than a body");
  const Mesh upright = figures::surface({{{0, 0, 0.03}, {0, 0, 1.83}, 0.025}});
  EXPECT_EQ(evidence_of(upright).problem, "the mesh is thinner than a body");
}

TEST(BodyEvidence, is_not_upright_where_the_body_is_much_wider_than_high) {
  EXPECT_TRUE(evidence_of(figures::surface(figures::person(90, 90))).is_upright());
  const Mesh bench = figures::surface({{{-0.8, 0, 0.3}, {0.8, 0, 0.3}, 0.3}}, 0.03);
  const BodyEvidence evidence = evidence_of(bench);
  EXPECT_EQ(evidence.problem, "");
  EXPECT_FALSE(evidence.is_upright());
}

TEST(BodyEvidence, takes_a_long_stick_in_a_hand_for_a_prop_and_not_for_an_arm) {
  std::vector<figures::Capsule> body = figures::person(70, 50);
  const Eigen::Vector3d hand = body[5].b;
  body.push_back({hand, hand + Eigen::Vector3d(0.9, 0, 0.1), 0.02});
  const BodyEvidence evidence = evidence_of(figures::surface(body));
  ASSERT_TRUE(evidence.prop);
  EXPECT_GT((evidence.prop->tip - evidence.prop->base).norm(), 0.5);
  EXPECT_LT((evidence.prop->tip - body.back().b).norm(), 0.08);
}

TEST(KinematicStructure, has_the_same_bone_lengths_at_every_pulse) {
  const std::vector<BodyEvidence> evidence = swinging(6);
  const KinematicStructure structure = kinematic_structure(evidence);
  ASSERT_EQ(structure.pulses.size(), evidence.size());
  for (const SkeletonPulse& pulse : structure.pulses) {
    for (size_t j = 1; j < kBodyJoints; ++j) {
      const auto joint = static_cast<Joint>(j);
      const double length = (pulse.joints[joint] - pulse.joints[parent(joint)]).norm();
      EXPECT_NEAR(length, structure.lengths.between(parent(joint), joint), 1e-6);
    }
  }
}

TEST(KinematicStructure, finds_head_and_ankles_and_keeps_left_and_right) {
  const KinematicStructure structure = kinematic_structure(swinging(6));
  ASSERT_EQ(structure.pulses.size(), 6U);
  const double side = structure.pulses[0].joints[kLeftShoulder].y();
  for (const SkeletonPulse& pulse : structure.pulses) {
    EXPECT_NEAR(pulse.joints[kHead].z(), 1.63, 0.08);
    EXPECT_NEAR(pulse.joints[kLeftAnkle].z(), 0.08, 0.06);
    EXPECT_NEAR(pulse.joints[kRightAnkle].z(), 0.08, 0.06);
    EXPECT_GT(side * pulse.joints[kLeftShoulder].y(), 0);
    EXPECT_LT(side * pulse.joints[kRightShoulder].y(), 0);
  }
}

TEST(KinematicStructure, has_the_left_side_left_of_the_toes) {
  const KinematicStructure structure = kinematic_structure(swinging(6));
  for (const SkeletonPulse& pulse : structure.pulses) {
    EXPECT_GT(pulse.joints[kLeftShoulder].y(), pulse.joints[kRightShoulder].y());
  }
}

/// Eight pulses of a standing person, `gap`, and eight pulses two metres further along x.
std::vector<BodyEvidence> standing_at_two_positions(const std::vector<BodyEvidence>& gap) {
  std::vector<BodyEvidence> evidence(8, evidence_of(figures::surface(figures::person(70, 50))));
  evidence.insert(evidence.end(), gap.begin(), gap.end());
  const BodyEvidence there = evidence_of(figures::surface(figures::person(70, 50, {2, 0, 0})));
  evidence.insert(evidence.end(), 8, there);
  return evidence;
}

/// Do the joints stand still before and after the gap, two metres apart?
void expect_two_positions(const KinematicStructure& structure) {
  ASSERT_EQ(structure.pulses.size(), 16U);
  const JointPositions& first = structure.pulses[0].joints;
  for (size_t n = 0; n < structure.pulses.size(); ++n) {
    const Eigen::Vector3d moved(n < 8 ? 0 : 2, 0, 0);
    for (size_t j = 0; j < kBodyJoints; ++j) {
      const auto joint = static_cast<Joint>(j);
      EXPECT_LT((structure.pulses[n].joints[joint] - first[joint] - moved).norm(), 0.1)
          << name(joint) << " " << n;
    }
  }
}

TEST(KinematicStructure, does_not_mix_the_poses_before_and_after_pulses_without_a_body) {
  const std::vector<BodyEvidence> gap(10, evidence_of({}));
  expect_two_positions(kinematic_structure(standing_at_two_positions(gap)));
}

TEST(KinematicStructure, does_not_mix_the_poses_before_and_after_lost_pulses) {
  std::vector<int64_t> pulses(16);
  for (size_t n = 0; n < pulses.size(); ++n) pulses[n] = static_cast<int64_t>(n < 8 ? n : n + 100);
  expect_two_positions(kinematic_structure(standing_at_two_positions({}), pulses));
}

TEST(KinematicStructure,
     has_the_prop_in_the_left_hand_where_that_is_clearly_nearer_at_most_pulses) {
  const auto pulses = [](double from_left_m, double from_right_m) {
    SkeletonPulse pulse;
    pulse.joints.fill(Eigen::Vector3d::Zero());
    pulse.rotations.fill(Eigen::Matrix3d::Identity());
    pulse.joints[kLeftWrist].x() = from_left_m;
    pulse.joints[kRightWrist].x() = -from_right_m;
    return std::vector<SkeletonPulse>(3, pulse);
  };
  EXPECT_EQ(hand_of_prop(pulses(0.1, 0.5)), kLeftWrist);
  EXPECT_EQ(hand_of_prop(pulses(0.5, 0.1)), kRightWrist);
  EXPECT_EQ(hand_of_prop(pulses(0.13, 0.22)), kRightWrist) << "both hands hold it";
  std::vector<SkeletonPulse> most = pulses(0.1, 0.5);
  most[1].joints[kLeftWrist].x() = 2;
  EXPECT_EQ(hand_of_prop(most), kLeftWrist);
  EXPECT_EQ(hand_of_prop({}), kRightWrist);
}

TEST(KinematicStructure, leaves_out_pulses_without_a_body) {
  std::vector<BodyEvidence> evidence = swinging(4);
  evidence.insert(evidence.begin() + 2, evidence_of({}));
  const KinematicStructure structure = kinematic_structure(evidence);
  ASSERT_EQ(structure.pulses.size(), 4U);
  EXPECT_EQ(structure.pulses[2].index, 3U);
  EXPECT_TRUE(kinematic_structure({}).pulses.empty());
}

}  // namespace
}  // namespace v3d::recon
