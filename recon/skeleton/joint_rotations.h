// Rotations of the joints of a skeleton from their positions.
#pragma once

#include <Eigen/Core>
#include <array>

#include "recon/skeleton/body_model.h"

namespace v3d::recon {

/// world_from_joint of every joint. Columns: x forward, y to the left, z along the bone: from the
/// pelvis and the neck to the head, from a hip, shoulder, knee or elbow back from its tip. A wrist,
/// an ankle and the head have the rotation of the bone that ends there; a prop has z to its tip.
/// Limbs bend about y. Standing upright, facing +x, with hanging arms: the identity.
std::array<Eigen::Matrix3d, kJoints> joint_rotations(const JointPositions& joints);

}  // namespace v3d::recon
