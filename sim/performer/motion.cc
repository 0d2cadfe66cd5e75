#include "sim/performer/motion.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>

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
constexpr std::array<Key, 11> kKeys = {{
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
// clang-format on
constexpr double kTurnPerPeriod = 360;  // yaw, degrees

double radians(double degrees) { return degrees * std::numbers::pi / 180; }

/// Keys before the first and after the last repeat with the period.
double key_time(int i) {
  const int n = static_cast<int>(kKeys.size());
  const int lap = (i < 0) ? -1 : i / n;
  return kKeys[static_cast<size_t>(i - lap * n)].time + lap * kActionPeriodSeconds;
}
double key_value(int i, int channel) {
  const int n = static_cast<int>(kKeys.size());
  const int lap = (i < 0) ? -1 : i / n;
  return kKeys[static_cast<size_t>(i - lap * n)].value[static_cast<size_t>(channel)] +
         (channel == kYaw ? lap * kTurnPerPeriod : 0);
}

/// Slope at a key, without overshoot: the weighted harmonic mean of the neighbouring slopes, 0 at a
/// turning point (Fritsch and Butland, "A method for constructing local monotone piecewise cubic
/// interpolants", 1984).
double key_slope(int i, int channel) {
  const double h0 = key_time(i) - key_time(i - 1);
  const double h1 = key_time(i + 1) - key_time(i);
  const double d0 = (key_value(i, channel) - key_value(i - 1, channel)) / h0;
  const double d1 = (key_value(i + 1, channel) - key_value(i, channel)) / h1;
  if (d0 * d1 <= 0) {
    return 0;
  }
  const double w0 = 2 * h1 + h0;
  const double w1 = h1 + 2 * h0;
  return (w0 + w1) / (w0 / d0 + w1 / d1);
}

double interpolate(double time, int key, int channel) {
  const double h = key_time(key + 1) - key_time(key);
  const double s = (time - key_time(key)) / h;
  const double a = key_value(key, channel);
  const double b = key_value(key + 1, channel);
  const double ta = key_slope(key, channel) * h;
  const double tb = key_slope(key + 1, channel) * h;
  const double s2 = s * s;
  const double s3 = s2 * s;
  return (2 * s3 - 3 * s2 + 1) * a + (s3 - 2 * s2 + s) * ta + (3 * s2 - 2 * s3) * b +
         (s3 - s2) * tb;
}

std::array<double, kChannels> channels_at(double seconds) {
  const double time = seconds - std::floor(seconds / kActionPeriodSeconds) * kActionPeriodSeconds;
  int key = static_cast<int>(kKeys.size()) - 1;
  while (key > 0 && kKeys[static_cast<size_t>(key)].time > time) {
    --key;
  }
  std::array<double, kChannels> value{};
  for (int c = 0; c < kChannels; ++c) {
    value[static_cast<size_t>(c)] = interpolate(time, key, c);
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

Pose pose_at(double seconds) {
  const auto v = channels_at(seconds);
  const Matrix3d heading = turn_z(v[kYaw]);
  const Vector3d ground(v[kRootX], v[kRootY], 0);
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
