#include "recon/skeleton/body_model.h"

#include <Eigen/Geometry>
#include <cmath>
#include <tuple>

#include "base/core/error.h"

namespace v3d::recon {
namespace {

using Eigen::Vector3d;

constexpr std::array<std::string_view, kJoints> kNames{
    "pelvis",         "neck",        "head",        "left_shoulder", "left_elbow", "left_wrist",
    "right_shoulder", "right_elbow", "right_wrist", "left_hip",      "left_knee",  "left_ankle",
    "right_hip",      "right_knee",  "right_ankle", "prop_base",     "prop_tip"};
constexpr std::array<Joint, kJoints> kParents{
    kPelvis, kPelvis,        kNeck,       kNeck,       kLeftShoulder, kLeftElbow,
    kNeck,   kRightShoulder, kRightElbow, kPelvis,     kLeftHip,      kLeftKnee,
    kPelvis, kRightHip,      kRightKnee,  kRightWrist, kPropBase};

struct Share {
  Joint a, b;
  double of_stature;
};
constexpr double kSpine = 0.2961 + proportions::kShoulderDrop - proportions::kHipDrop;

std::vector<Share> shares() {
  using namespace proportions;
  const double shoulder = std::hypot(kShoulderHalf, kShoulderDrop);
  const double hip = std::hypot(kHipHalf, kHipDrop);
  return {{kPelvis, kNeck, kSpine},
          {kNeck, kHead, 0.096},
          {kNeck, kLeftShoulder, shoulder},
          {kNeck, kRightShoulder, shoulder},
          {kLeftShoulder, kRightShoulder, 2 * kShoulderHalf},
          {kPelvis, kLeftHip, hip},
          {kPelvis, kRightHip, hip},
          {kLeftHip, kRightHip, 2 * kHipHalf},
          {kLeftShoulder, kLeftElbow, 0.1618},
          {kRightShoulder, kRightElbow, 0.1618},
          {kLeftElbow, kLeftWrist, 0.1545},
          {kRightElbow, kRightWrist, 0.1545},
          {kLeftHip, kLeftKnee, 0.2425},
          {kRightHip, kRightKnee, 0.2425},
          {kLeftKnee, kLeftAnkle, 0.2493},
          {kRightKnee, kRightAnkle, 0.2493}};
}

Capsule::End end_at(Joint joint) { return {{joint, joint, joint}, {1, 0, 0}}; }
Capsule::End mean_of(Joint a, double of_a, Joint b, double of_b, Joint c, double of_c) {
  return {{a, b, c}, {of_a, of_b, of_c}};
}

Capsule capsule(const Capsule::End& a, const Capsule::End& b, double from_m, double to_m) {
  Capsule result{a, b, {}};
  for (size_t k = 0; k < Capsule::kKnots; ++k) {
    const double t = static_cast<double>(k) / (Capsule::kKnots - 1);
    result.radius_m[k] = from_m + t * (to_m - from_m);
  }
  return result;
}

}  // namespace

std::string_view name(Joint joint) { return kNames[joint]; }
Joint parent(Joint joint, Joint prop_hand) {
  return joint == kPropBase ? prop_hand : kParents[joint];
}

BodyLengths::BodyLengths(double stature_m, double prop_m) : stature_m_(stature_m) {
  for (const Share& share : shares()) {
    bones_.push_back({share.a, share.b, share.of_stature * stature_m});
  }
  bones_.push_back({kPropBase, kPropTip, prop_m});
}

double BodyLengths::between(Joint a, Joint b) const {
  for (const Bone& bone : bones_) {
    if ((bone.a == a && bone.b == b) || (bone.a == b && bone.b == a)) return bone.metres;
  }
  V3D_CHECK(false && "no such bone");
  return 0;
}

std::vector<Capsule> body_outline(double h) {
  std::vector<Capsule> result;
  const auto add = [&](const Capsule::End& a, const Capsule::End& b, double from, double to) {
    result.push_back(capsule(a, b, from * h, to * h));
  };
  add(end_at(kHead), end_at(kHead), 0.056, 0.056);
  add(end_at(kNeck), end_at(kHead), 0.034, 0.034);
  for (const auto& [hip, shoulder] :
       {std::pair{kLeftHip, kLeftShoulder}, std::pair{kRightHip, kRightShoulder}}) {
    add(mean_of(hip, 0.8, kPelvis, 0.2, kNeck, 0),
        mean_of(shoulder, 0.55, kNeck, 0.35, kPelvis, 0.1), 0.062, 0.062);
    add(mean_of(kNeck, 0.5, shoulder, 0.5, kPelvis, 0), end_at(shoulder), 0.035, 0.03);
  }
  add(end_at(kLeftHip), end_at(kRightHip), 0.065, 0.065);
  for (const auto& [root, middle, tip] : {std::tuple{kLeftShoulder, kLeftElbow, kLeftWrist},
                                          std::tuple{kRightShoulder, kRightElbow, kRightWrist}}) {
    add(end_at(root), end_at(middle), 0.03, 0.026);
    add(end_at(middle), end_at(tip), 0.026, 0.02);
  }
  for (const auto& [root, middle, tip] : {std::tuple{kLeftHip, kLeftKnee, kLeftAnkle},
                                          std::tuple{kRightHip, kRightKnee, kRightAnkle}}) {
    add(end_at(root), end_at(middle), 0.055, 0.035);
    add(end_at(middle), end_at(tip), 0.035, 0.025);
  }
  add(end_at(kPropBase), end_at(kPropTip), 0.017, 0.017);
  V3D_CHECK(result.size() == kPropCapsule + 1);
  return result;
}

JointPositions standing_pose(const BodyLengths& lengths, const Vector3d& pelvis, double yaw) {
  using namespace proportions;
  const double h = lengths.stature_m();
  const Eigen::AngleAxisd turn(yaw, Vector3d::UnitZ());
  JointPositions pose;
  const auto set = [&](Joint joint, const Vector3d& at) { pose[joint] = pelvis + turn * (h * at); };
  set(kPelvis, Vector3d::Zero());
  set(kNeck, {0, 0, kSpine});
  set(kHead, {0, 0, kSpine + 0.096});
  for (const double side : {1.0, -1.0}) {
    const bool left = side > 0;
    const double shoulder = kSpine - kShoulderDrop;
    set(left ? kLeftShoulder : kRightShoulder, {0, side * kShoulderHalf, shoulder});
    set(left ? kLeftElbow : kRightElbow, {-0.01, side * 0.13, shoulder - 0.159});
    set(left ? kLeftWrist : kRightWrist, {0.05, side * 0.13, shoulder - 0.301});
    set(left ? kLeftHip : kRightHip, {0, side * kHipHalf, -kHipDrop});
    set(left ? kLeftKnee : kRightKnee, {0.01, side * kHipHalf, -kHipDrop - 0.2423});
    set(left ? kLeftAnkle : kRightAnkle, {0, side * kHipHalf, -kHipDrop - 0.4914});
  }
  set(kPropBase, {0.1, -0.13, kSpine - kShoulderDrop - 0.301});
  pose[kPropTip] = pose[kPropBase] + turn * Vector3d(lengths.between(kPropBase, kPropTip), 0, 0);
  return pose;
}

namespace {

using Eigen::Matrix3d;

/// z along `up`, y as near to `left` as possible.
Matrix3d frame(const Vector3d& up, const Vector3d& left) {
  Matrix3d result;
  const Vector3d z = up.normalized();
  Vector3d y = left - left.dot(z) * z;
  if (y.norm() < 1e-6) y = z.unitOrthogonal();
  y.normalize();
  result << y.cross(z), y, z;
  return result;
}

}  // namespace

std::array<Matrix3d, kJoints> joint_rotations(const JointPositions& joints) {
  std::array<Matrix3d, kJoints> result;
  const Vector3d spine = joints[kNeck] - joints[kPelvis];
  result[kPelvis] = frame(spine, joints[kLeftHip] - joints[kRightHip]);
  const Vector3d across = joints[kLeftShoulder] - joints[kRightShoulder];
  result[kNeck] = frame(spine, across);
  result[kHead] = frame(joints[kHead] - joints[kNeck], across);
  for (const auto& [root, middle, tip, trunk] :
       {std::tuple{kLeftShoulder, kLeftElbow, kLeftWrist, kNeck},
        std::tuple{kRightShoulder, kRightElbow, kRightWrist, kNeck},
        std::tuple{kLeftHip, kLeftKnee, kLeftAnkle, kPelvis},
        std::tuple{kRightHip, kRightKnee, kRightAnkle, kPelvis}}) {
    const Vector3d upper = joints[root] - joints[middle], lower = joints[middle] - joints[tip];
    // The hinge of an elbow bends forward, that of a knee backward: y to the left in both.
    Vector3d hinge = trunk == kNeck ? lower.cross(upper) : upper.cross(lower);
    hinge = hinge.norm() > 0.02 * upper.norm() * lower.norm() ? Vector3d(hinge.normalized())
                                                              : Vector3d(Vector3d::Zero());
    const Vector3d left = hinge + 0.05 * result[trunk].col(1);
    result[root] = frame(upper, left);
    result[middle] = result[tip] = frame(lower, left);
  }
  result[kPropBase] = frame(joints[kPropTip] - joints[kPropBase], across);
  result[kPropTip] = result[kPropBase];
  return result;
}

}  // namespace v3d::recon
