// The motion of performers with a sword, interpolated between key poses with the period
// kActionPeriodSeconds. World frame, metres.
#pragma once

#include <Eigen/Core>
#include <cstdint>

#include "base/geometry/rigid_transform.h"

namespace v3d::sim {

/// Two bones: shoulder, elbow, wrist; or hip, knee, ankle.
struct Limb {
  Eigen::Vector3d root, joint, tip;
};

enum Side : int { kLeft = 0, kRight = 1 };

/// The pose of the skeleton at one time. Body frames: x forward, y left, z up.
struct Pose {
  RigidTransform world_from_pelvis;  ///< origin between the hips
  RigidTransform world_from_chest;   ///< origin at the base of the neck
  RigidTransform world_from_head;    ///< origin in the middle of the head
  Limb arm[2];
  Limb leg[2];
  Eigen::Matrix3d foot[2];          ///< world_from_foot, rotation only; the ankle is leg[].tip
  RigidTransform world_from_sword;  ///< origin at the guard; z along the blade, x to its edge
};

enum class Action : uint8_t {
  kCut,     ///< alone: stance, raise, cut, recover, turn
  kAttack,  ///< first in a fight: cuts, pushes, then blocks and is pushed
  kDefence  ///< second in a fight: blocks and is pushed, then cuts and pushes
};

/// An action at a place.
struct Motion {
  Action action = Action::kCut;
  Eigen::Vector2d position = Eigen::Vector2d::Zero();  ///< origin of the key poses, metres
  double yaw_deg = 0;  ///< direction in which the action begins, from +x to +y
};

inline constexpr double kBladeLength = 0.75;
inline constexpr double kHandleLength = 0.24;

/// The position of a hand on the handle: z in the frame of the sword, metres.
double grip_of(Side side);

/// The pose at any time; pose_at(t + kActionPeriodSeconds) equals pose_at(t).
Pose pose_at(double seconds, const Motion& motion = {});

/// The tip of the blade, world frame, metres.
Eigen::Vector3d sword_tip(const Pose& pose);

}  // namespace v3d::sim
