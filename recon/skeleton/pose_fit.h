// Fits the pose of a body to the surface of one pulse.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "recon/skeleton/body_model.h"

namespace v3d::recon {

/// A joint that should be near a position.
struct JointTarget {
  Joint joint = kPelvis;
  Eigen::Vector3d position = Eigen::Vector3d::Zero();  ///< world, metres
  double weight = 1;
};

/// A point of the surface; `capsule`: the only one that it can belong to, kAnyCapsule: the nearest
/// one that is not the prop.
struct OutlinePoint {
  static constexpr int kAnyCapsule = -1;
  Eigen::Vector3d position = Eigen::Vector3d::Zero();  ///< world, metres
  int capsule = kAnyCapsule;
};

struct PoseProblem {
  std::span<const OutlinePoint> points;
  std::vector<JointTarget> targets;
  JointPositions
      expected;  ///< from other pulses; the pose stays near it where nothing else is known
  double expected_weight = 1;
  bool has_prop = false;
  /// Direction from the chest to both hands where they hold one thing in front of it: the shoulders
  /// are across it. Horizontal unit vector.
  std::optional<Eigen::Vector3d> towards_hands;
};

struct FittedPose {
  JointPositions joints;
  /// Root mean square distance of the points from the capsules next to a joint, metres; and their
  /// number.
  std::array<double, kJoints> residual_m{};
  std::array<size_t, kJoints> support{};
};

/// Distance of a point from a capsule of a pose.
struct CapsuleDistance {
  double along = 0;   ///< 0 at end a to 1 at end b
  double metres = 0;  ///< from the axis
};
CapsuleDistance distance_to(const Capsule& capsule, const JointPositions& joints,
                            const Eigen::Vector3d& position);

/// Gauss-Newton fit from `start`: the surface is at the radius of the nearest capsule (robust),
/// bones have their lengths, targets and expected positions attract joints; knees bend forward,
/// elbows outward and down where nothing else is known. Deterministic; thread-safe.
FittedPose fit_pose(const PoseProblem& problem, const BodyLengths& lengths,
                    std::span<const Capsule> outline, const JointPositions& start, int iterations);

/// Moves joints so that all bones have their lengths: first both ends of each bone in turn, so that
/// errors do not add up along a limb, then exactly, from the pelvis outwards.
///
/// Source: Mueller, Heidelberger, Hennix and Ratcliff, Position based dynamics, Journal of Visual
/// Communication and Image Representation 18, 2007 (distance constraints).
void restore_lengths(const BodyLengths& lengths, JointPositions& joints);

}  // namespace v3d::recon
