// The body that is fitted to a performer: joints, bones, proportions, outline, rotations.
#pragma once

#include <Eigen/Core>
#include <array>
#include <cstddef>
#include <string_view>
#include <vector>

namespace v3d::recon {

/// Joints of a body. Left and right are those of the performer.
enum Joint : size_t {
  kPelvis,  ///< between the hips, at 3 % of the stature above them
  kNeck,    ///< base of the neck
  kHead,    ///< middle of the head
  kLeftShoulder,
  kLeftElbow,
  kLeftWrist,
  kRightShoulder,
  kRightElbow,
  kRightWrist,
  kLeftHip,
  kLeftKnee,
  kLeftAnkle,
  kRightHip,
  kRightKnee,
  kRightAnkle,
  kBodyJoints,
  kPropBase = kBodyJoints,  ///< where a hand holds the prop
  kPropTip,
  kJoints
};

std::string_view name(Joint joint);
/// The joint nearer to the pelvis; the pelvis has itself. `prop_hand`: the wrist of the hand that
/// holds the prop, the parent of its base.
Joint parent(Joint joint, Joint prop_hand = kRightWrist);

/// Positions of all joints, world, metres.
using JointPositions = std::array<Eigen::Vector3d, kJoints>;

/// A distance between two joints that a pose keeps.
struct Bone {
  Joint a = kPelvis, b = kPelvis;
  double metres = 0;
};

/// Lengths of the bones of a body. The last one is the prop.
class BodyLengths {
 public:
  /// Proportions of an adult. Sources: de Leva, Journal of Biomechanics 29, 1996 (limbs, trunk,
  /// head); Bell et al., Journal of Biomechanics 23, 1990 (hips); Drillis and Contini, 1966
  /// (shoulders, feet).
  BodyLengths(double stature_m, double prop_m);

  double stature_m() const { return stature_m_; }
  const std::vector<Bone>& bones() const { return bones_; }
  std::vector<Bone>& bones() { return bones_; }
  double between(Joint a, Joint b) const;

 private:
  double stature_m_;
  std::vector<Bone> bones_;
};

/// Shares of the stature.
namespace proportions {
inline constexpr double kHeadTop = 0.058;  ///< from the middle of the head
inline constexpr double kAnkle = 0.039;    ///< above the ground
inline constexpr double kGrip = 0.045;     ///< from the wrist to the middle of the fist
inline constexpr double kFootLength = 0.152;
inline constexpr double kHipHalf = 0.0493, kHipDrop = 0.03;
inline constexpr double kShoulderHalf = 0.104, kShoulderDrop = 0.0353;
}  // namespace proportions

/// A piece of the outline: a segment with a radius that changes along it. Its two ends are weighted
/// means of joints.
struct Capsule {
  static constexpr size_t kKnots = 4;
  struct End {
    std::array<Joint, 3> joint{};
    std::array<double, 3> weight{};
    Eigen::Vector3d at(const JointPositions& joints) const {
      return weight[0] * joints[joint[0]] + weight[1] * joints[joint[1]] +
             weight[2] * joints[joint[2]];
    }
  };
  End a, b;
  std::array<double, kKnots> radius_m{};  ///< at equal steps from a to b

  double radius(double t) const {
    const double at = t * (kKnots - 1);
    const auto knot = static_cast<size_t>(at < kKnots - 2 ? at : kKnots - 2);
    const double part = at - static_cast<double>(knot);
    return (1 - part) * radius_m[knot] + part * radius_m[knot + 1];
  }
};

/// The outline of a body without clothes.
std::vector<Capsule> body_outline(double stature_m);
/// Index of the prop in body_outline(): the last one.
inline constexpr size_t kPropCapsule = 15, kHeadCapsule = 0;

/// A standing body: pelvis at `pelvis`, forward direction at `yaw` radians from +x to +y.
JointPositions standing_pose(const BodyLengths& lengths, const Eigen::Vector3d& pelvis, double yaw);

/// world_from_joint of every joint. Columns: x forward, y to the left, z along the bone: from the
/// pelvis and the neck to the head, from a hip, shoulder, knee or elbow back from its tip. A wrist,
/// an ankle and the head have the rotation of the bone that ends there; a prop has z to its tip.
/// Limbs bend about y. Standing upright, facing +x, with hanging arms: the identity.
std::array<Eigen::Matrix3d, kJoints> joint_rotations(const JointPositions& joints);

}  // namespace v3d::recon
