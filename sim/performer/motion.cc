#include "sim/performer/motion.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <span>

#include "sim/rendering/scene.h"

namespace v3d::sim {
namespace {

using Eigen::AngleAxisd;
using Eigen::Matrix3d;
using Eigen::Vector3d;

// Lengths of a person of 1.75 m.
constexpr double kHipHalfWidth = 0.095;
constexpr double kThigh = 0.43;
constexpr double kShank = 0.42;
constexpr double kSpine = 0.50;  // pelvis to the base of the neck
constexpr double kNeckToHead = 0.165;
constexpr double kShoulderHalfWidth = 0.185;
constexpr double kShoulderDrop = 0.06;  // below the base of the neck
constexpr double kUpperArm = 0.29;
constexpr double kForearm = 0.265;
constexpr double kAnkleHeight = 0.075;

/// One key pose. Positions of hands and feet are relative to the ground point under the pelvis, in
/// the frame that turns with `yaw`. Metres and degrees.
enum Channel : int {
  kRootX,
  kRootY,
  kYaw,
  kHeight,
  kLean,
  kTwist,
  kNod,
  kHandX,
  kHandY,
  kHandZ,
  kPitch,
  kSwing,
  kLeftX,
  kLeftY,
  kLeftLift,
  kRightX,
  kRightY,
  kRightLift,
  kChannels
};
struct Key {
  double time;
  std::array<double, kChannels> value;
};

// clang-format off
constexpr std::array<Key, 11> kCutKeys = {{
  //       root x  y  yaw   height lean twist nod   hand x  y     z     pitch swing  left x  y    lift  right x  y    lift
  {0.00, {-0.30, 0.0,   0, 0.870,  3,  8,   0,     0.38,  0.00, 1.00,   35,  0,    -0.20, 0.13, 0.00,  0.20, -0.11, 0.00}},
  {0.40, {-0.32, 0.0,   0, 0.875,  2,  5,  -3,     0.36,  0.00, 1.12,   52,  0,    -0.20, 0.13, 0.00,  0.20, -0.11, 0.00}},
  {0.85, {-0.35, 0.0,   0, 0.885, -4,  0,  -6,     0.20,  0.00, 1.76,  142,  0,    -0.18, 0.13, 0.00,  0.18, -0.11, 0.02}},
  {1.10, {-0.33, 0.0,   0, 0.880, -5,  0,  -6,     0.18,  0.00, 1.78,  150,  0,    -0.20, 0.13, 0.00,  0.24, -0.11, 0.06}},
  {1.385, {-0.05, 0.0,   0, 0.800, 14,  0,   4,     0.50,  0.00, 1.08,    6,  0,    -0.44, 0.13, 0.00,  0.40, -0.11, 0.00}},
  {1.75, { 0.00, 0.0,   0, 0.795, 16,  0,   4,     0.46,  0.00, 0.96,  -10,  0,    -0.42, 0.13, 0.00,  0.38, -0.11, 0.00}},
  {2.20, {-0.12, 0.0,   0, 0.860,  5,  5,   0,     0.38,  0.00, 1.02,   32,  0,    -0.22, 0.13, 0.04,  0.24, -0.11, 0.00}},
  {2.50, {-0.18, 0.0,   8, 0.870,  3, 12,   0,     0.34, -0.03, 1.05,   50,  8,    -0.16, 0.14, 0.00,  0.20, -0.12, 0.03}},
  {2.95, {-0.22, 0.0, 150, 0.875,  3, 18,   0,     0.30, -0.05, 1.12,   66, 10,    -0.10, 0.15, 0.06,  0.12, -0.14, 0.00}},
  {3.30, {-0.26, 0.0, 265, 0.875,  3, 14,   0,     0.32, -0.03, 1.10,   58,  6,    -0.14, 0.14, 0.00,  0.16, -0.13, 0.06}},
  {3.70, {-0.29, 0.0, 355, 0.870,  3,  9,   0,     0.37,  0.00, 1.02,   38,  1,    -0.19, 0.13, 0.02,  0.20, -0.11, 0.00}},
}};

// A fight of two, who begin 1.6 m apart and face each other: a cut and its block, a bind hilt to
// hilt, a push, and the same with exchanged roles.
constexpr std::array<Key, 11> kAttackKeys = {{
  //       root x  y  yaw   height lean twist nod   hand x  y     z     pitch swing  left x  y    lift  right x  y    lift
  {0.00, { 0.00, 0.00,  0, 0.870,  3,  8,   0,     0.38,  0.02, 1.00,   40,  4,    -0.20, 0.13, 0.00,  0.20, -0.11, 0.00}},
  {0.40, {-0.02, 0.00,  0, 0.880, -4,  0,  -4,     0.18,  0.00, 1.72,  138,  0,    -0.20, 0.13, 0.00,  0.20, -0.11, 0.02}},
  {0.62, { 0.02, 0.00,  0, 0.880, -4,  0,  -4,     0.18,  0.00, 1.75,  146,  0,    -0.22, 0.13, 0.00,  0.24, -0.11, 0.06}},
  {0.88, { 0.20, 0.02,  0, 0.820, 11,  0,   3,     0.48,  0.02, 1.22,   46,  2,    -0.40, 0.13, 0.00,  0.36, -0.11, 0.00}},
  {1.20, { 0.44, 0.03,  0, 0.860,  5,  4,   0,     0.34,  0.02, 1.12,   78,  2,    -0.20, 0.13, 0.02,  0.20, -0.11, 0.00}},
  {1.50, { 0.50, 0.03,  0, 0.850, 10,  0,   0,     0.44,  0.02, 1.15,   80,  2,    -0.24, 0.13, 0.00,  0.22, -0.11, 0.03}},
  {1.75, { 0.62, 0.02,  0, 0.840, 14,  0,   2,     0.49,  0.02, 1.16,   80,  2,    -0.34, 0.13, 0.00,  0.28, -0.11, 0.00}},
  {2.10, { 0.34, 0.00,  0, 0.865,  4,  6,   0,     0.38,  0.02, 1.02,   42,  4,    -0.20, 0.13, 0.03,  0.20, -0.11, 0.00}},
  {2.72, { 0.12, 0.00,  0, 0.860, -2,  0,   0,     0.36,  0.00, 1.28,   62,  8,    -0.22, 0.13, 0.00,  0.20, -0.11, 0.00}},
  {3.05, { 0.36, 0.00,  0, 0.865,  2,  0,   0,     0.30,  0.02, 1.10,   80,  2,    -0.18, 0.13, 0.00,  0.18, -0.11, 0.00}},
  {3.50, { 0.14, 0.00,  0, 0.860, -6,  0,   0,     0.25,  0.02, 1.12,   82,  2,    -0.24, 0.13, 0.03,  0.18, -0.11, 0.00}},
}};
constexpr std::array<Key, 11> kDefenceKeys = {{
  //       root x  y  yaw   height lean twist nod   hand x  y     z     pitch swing  left x  y    lift  right x  y    lift
  {0.00, { 0.00, 0.00,  0, 0.860,  3,  8,   0,     0.37,  0.02, 1.02,   42,  4,    -0.20, 0.13, 0.00,  0.20, -0.11, 0.00}},
  {0.60, { 0.00, 0.00,  0, 0.865,  2,  5,  -2,     0.37,  0.01, 1.12,   52,  4,    -0.20, 0.13, 0.00,  0.20, -0.11, 0.00}},
  {0.88, { 0.04, 0.00,  0, 0.855, -2,  0,   0,     0.36,  0.00, 1.28,   62,  8,    -0.22, 0.13, 0.00,  0.20, -0.11, 0.00}},
  {1.20, { 0.40, 0.00,  0, 0.865,  2,  0,   0,     0.32,  0.02, 1.12,   78,  2,    -0.18, 0.13, 0.00,  0.18, -0.11, 0.00}},
  {1.50, { 0.34, 0.00,  0, 0.860, -2,  0,   0,     0.26,  0.02, 1.12,   82,  2,    -0.20, 0.13, 0.02,  0.18, -0.11, 0.00}},
  {1.75, { 0.20, 0.00,  0, 0.850, -6,  0,   0,     0.25,  0.02, 1.12,   82,  2,    -0.28, 0.13, 0.00,  0.18, -0.11, 0.03}},
  {2.10, {-0.06, 0.02,  0, 0.870,  2,  6,   0,     0.36,  0.02, 1.05,   46,  4,    -0.22, 0.13, 0.00,  0.20, -0.11, 0.00}},
  {2.45, { 0.04, 0.02,  0, 0.880, -4,  0,  -4,     0.18,  0.00, 1.75,  144,  0,    -0.20, 0.13, 0.00,  0.22, -0.11, 0.05}},
  {2.72, { 0.18, 0.02,  0, 0.820, 11,  0,   3,     0.48,  0.02, 1.20,   44,  2,    -0.40, 0.13, 0.00,  0.36, -0.11, 0.00}},
  {3.05, { 0.46, 0.02,  0, 0.855,  8,  0,   0,     0.40,  0.02, 1.14,   78,  2,    -0.22, 0.13, 0.02,  0.22, -0.11, 0.00}},
  {3.50, { 0.64, 0.01,  0, 0.840, 13,  0,   2,     0.49,  0.02, 1.16,   80,  2,    -0.34, 0.13, 0.00,  0.28, -0.11, 0.02}},
}};
// clang-format on

/// The key poses of an action.
struct Keys {
  std::span<const Key> keys;
  double turn_per_period = 0;  ///< yaw, degrees
};

Keys keys_of(Action action) {
  switch (action) {
    case Action::kCut:
      return {kCutKeys, 360};
    case Action::kAttack:
      return {kAttackKeys};
    case Action::kDefence:
      return {kDefenceKeys};
  }
  return {};
}

double radians(double degrees) { return degrees * std::numbers::pi / 180; }

/// Keys before the first and after the last repeat with the period.
class RepeatedKeys {
 public:
  explicit RepeatedKeys(const Keys& keys) : keys_(keys), n_(static_cast<int>(keys.keys.size())) {}

  double time(int i) const { return key(i).time + lap(i) * kActionPeriodSeconds; }
  double value(int i, int channel) const {
    return key(i).value[static_cast<size_t>(channel)] +
           (channel == kYaw ? lap(i) * keys_.turn_per_period : 0);
  }

  /// Slope at a key, without overshoot: the weighted harmonic mean of the neighbouring slopes, 0 at
  /// a turning point (Fritsch and Butland, "A method for constructing local monotone piecewise
  /// cubic interpolants", 1984).
  double slope(int i, int channel) const {
    const double h0 = time(i) - time(i - 1);
    const double h1 = time(i + 1) - time(i);
    const double d0 = (value(i, channel) - value(i - 1, channel)) / h0;
    const double d1 = (value(i + 1, channel) - value(i, channel)) / h1;
    if (d0 * d1 <= 0) {
      return 0;
    }
    const double w0 = 2 * h1 + h0;
    const double w1 = h1 + 2 * h0;
    return (w0 + w1) / (w0 / d0 + w1 / d1);
  }

  /// The value at a time between a key and the next one.
  double interpolate(double seconds, int i, int channel) const {
    const double h = time(i + 1) - time(i);
    const double s = (seconds - time(i)) / h;
    const double a = value(i, channel);
    const double b = value(i + 1, channel);
    const double ta = slope(i, channel) * h;
    const double tb = slope(i + 1, channel) * h;
    const double s2 = s * s;
    const double s3 = s2 * s;
    return (2 * s3 - 3 * s2 + 1) * a + (s3 - 2 * s2 + s) * ta + (3 * s2 - 2 * s3) * b +
           (s3 - s2) * tb;
  }

  /// The last key that is not after a time within the period.
  int before(double seconds) const {
    int i = n_ - 1;
    while (i > 0 && time(i) > seconds) {
      --i;
    }
    return i;
  }

 private:
  int lap(int i) const { return (i < 0) ? -1 : i / n_; }
  const Key& key(int i) const { return keys_.keys[static_cast<size_t>(i - lap(i) * n_)]; }

  Keys keys_;
  int n_;
};

std::array<double, kChannels> channels_at(double seconds, Action action) {
  const double time = seconds - std::floor(seconds / kActionPeriodSeconds) * kActionPeriodSeconds;
  const RepeatedKeys keys(keys_of(action));
  const int key = keys.before(time);
  std::array<double, kChannels> value{};
  for (int c = 0; c < kChannels; ++c) {
    value[static_cast<size_t>(c)] = keys.interpolate(time, key, c);
  }
  return value;
}

Matrix3d turn_z(double degrees) {
  return AngleAxisd(radians(degrees), Vector3d::UnitZ()).toRotationMatrix();
}
/// Positive angles tilt z towards x.
Matrix3d lean_forward(double degrees) {
  return AngleAxisd(radians(degrees), Vector3d::UnitY()).toRotationMatrix();
}

/// Two-bone inverse kinematics from `root` to `target`; `pole` gives the side of the joint. The tip
/// is as close as possible to a target that is out of reach.
Limb reach(const Vector3d& root, const Vector3d& target, double upper, double lower,
           const Vector3d& pole) {
  const Vector3d to = target - root;
  const double distance =
      std::clamp(to.norm(), std::abs(upper - lower) + 1e-3, upper + lower - 1e-3);
  const Vector3d along = to.normalized();
  const double forward = (upper * upper - lower * lower + distance * distance) / (2 * distance);
  const double aside = std::sqrt(std::max(0.0, upper * upper - forward * forward));
  const Vector3d bend = (pole - pole.dot(along) * along).normalized();
  return {root, root + forward * along + aside * bend, root + distance * along};
}

/// The arm from the shoulder to the handle.
Limb arm_of(const Pose& pose, const Matrix3d& heading, Side side) {
  const double sign = side == kLeft ? 1 : -1;
  const Vector3d shoulder =
      pose.world_from_chest * Vector3d(0, sign * kShoulderHalfWidth, -kShoulderDrop);
  const Vector3d hand = pose.world_from_sword * Vector3d(0, 0, grip_of(side));
  // The wrist is a palm's length from the handle, towards the shoulder.
  const Vector3d wrist = hand + 0.075 * (shoulder - hand).normalized();
  return reach(shoulder, wrist, kUpperArm, kForearm, heading * Vector3d(-0.25, 0.8 * sign, -0.75));
}

/// The leg from the hip to an ankle.
Limb leg_of(const Pose& pose, const Matrix3d& heading, Side side, const Vector3d& ankle) {
  const double sign = side == kLeft ? 1 : -1;
  const Vector3d hip = pose.world_from_pelvis * Vector3d(0, sign * kHipHalfWidth, -0.05);
  return reach(hip, ankle, kThigh, kShank, heading * Vector3d(1, 0.25 * sign, 0));
}

}  // namespace

double grip_of(Side side) { return side == kLeft ? -0.17 : -0.05; }

Pose pose_at(double seconds, const Motion& motion) {
  const auto v = channels_at(seconds, motion.action);
  const Matrix3d heading = turn_z(motion.yaw_deg + v[kYaw]);
  const Vector3d ground = Vector3d(motion.position.x(), motion.position.y(), 0) +
                          turn_z(motion.yaw_deg) * Vector3d(v[kRootX], v[kRootY], 0);
  const auto in_world = [&](double x, double y, double z) -> Vector3d {
    return ground + heading * Vector3d(x, y, z);
  };

  Pose pose;
  const Matrix3d pelvis = heading * turn_z(-0.5 * v[kTwist]) * lean_forward(0.4 * v[kLean]);
  const Matrix3d chest = heading * turn_z(0.5 * v[kTwist]) * lean_forward(v[kLean]);
  const Matrix3d head = heading * lean_forward(0.3 * v[kLean] + v[kNod]);
  pose.world_from_pelvis = {pelvis, in_world(0, 0, v[kHeight] + 0.05)};
  pose.world_from_chest = {
      chest, pose.world_from_pelvis.translation + 0.5 * kSpine * (pelvis.col(2) + chest.col(2))};
  pose.world_from_head = {head, pose.world_from_chest * Vector3d(0.01, 0, 0.04) +
                                    head * Vector3d(0.015, 0, kNeckToHead - 0.04)};

  // The blade points straight ahead; pitch turns it up, swing turns it to the left.
  const Matrix3d blade = heading * turn_z(v[kSwing]) * lean_forward(90 - v[kPitch]);
  const Vector3d between_hands = in_world(v[kHandX], v[kHandY], v[kHandZ]);
  const double middle = 0.5 * (grip_of(kLeft) + grip_of(kRight));
  pose.world_from_sword = {blade, between_hands - blade * Vector3d(0, 0, middle)};

  const Vector3d left_ankle = in_world(v[kLeftX], v[kLeftY], kAnkleHeight + v[kLeftLift]);
  const Vector3d right_ankle = in_world(v[kRightX], v[kRightY], kAnkleHeight + v[kRightLift]);
  for (const Side side : {kLeft, kRight}) {
    pose.arm[side] = arm_of(pose, heading, side);
    pose.leg[side] = leg_of(pose, heading, side, side == kLeft ? left_ankle : right_ankle);
    pose.foot[side] = heading * turn_z(side == kLeft ? 12 : -12);
  }
  return pose;
}

Eigen::Vector3d sword_tip(const Pose& pose) {
  return pose.world_from_sword * Vector3d(0, 0, kBladeLength);
}

}  // namespace v3d::sim
