// Kinematic structure of a performer, learnt from the pulses of a take.
#pragma once

#include <Eigen/Core>
#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "recon/skeleton/body_evidence.h"
#include "recon/skeleton/body_model.h"

namespace v3d::recon {

/// A pulse with a skeleton. World frame, metres.
struct SkeletonPulse {
  size_t index = 0;  ///< of the evidence
  JointPositions joints;
  /// world_from_joint: x forward, y to the left, z from a joint towards the head; of limbs z points
  /// from the tip to the root. The identity of a person who stands upright and looks along +x.
  std::array<Eigen::Matrix3d, kJoints> rotations;
  std::array<double, kJoints> confidence{};  ///< 0 to 1
};

struct KinematicStructure {
  BodyLengths lengths{0, 0};
  bool has_prop = false;
  Joint prop_hand = kRightWrist;      ///< the wrist of the hand that holds the prop
  std::vector<Capsule> outline;       ///< of the performer, as body_outline()
  std::vector<SkeletonPulse> pulses;  ///< in the order of the evidence
  size_t start = 0;                   ///< index of the evidence of the best pulse to begin with
  size_t good = 0;                    ///< pulses whose graph shows head, feet and hands or a prop
  size_t upright = 0;                 ///< pulses whose body is not much wider than high
  /// The joint nearer to the pelvis; the base of a prop has the hand.
  Joint parent_of(Joint joint) const { return parent(joint, prop_hand); }
};

/// The wrist of the hand that holds the prop of these skeletons: the left one where it is at most
/// half as far from the base of the prop as the right one at most pulses, otherwise the right one.
Joint hand_of_prop(std::span<const SkeletonPulse> pulses);

/// Learns one skeleton with constant bone lengths from the evidence of all pulses. `pulses`: the
/// number of each pulse, ascending; empty: they are successive. Evidence with a problem gives no
/// pulse; no evidence gives no structure (no pulses). Works in the caller's TBB arena;
/// deterministic. Method and sources: docs/skeleton.md.
KinematicStructure kinematic_structure(std::span<const BodyEvidence> evidence,
                                       std::span<const int64_t> pulses = {});

}  // namespace v3d::recon
