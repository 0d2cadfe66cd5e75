#include "sim/performer/performer.h"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <numbers>

#include "base/core/error.h"
#include "sim/performer/motion.h"
#include "sim/performer/skinned_model.h"
#include "sim/rendering/noise.h"
#include "sim/rendering/scene.h"

namespace v3d::sim {
namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;

constexpr double kTwoPi = 2 * std::numbers::pi;

double mix_of(double a, double b, double s) { return a + s * (b - a); }
double smooth(double s) {
  s = std::clamp(s, 0.0, 1.0);
  return s * s * (3 - 2 * s);
}

/// Piecewise linear interpolation of (position, value) pairs with ascending positions.
template <size_t N>
double profile(const double (&points)[N][2], double s) {
  for (size_t i = 1; i < N; ++i) {
    if (s <= points[i][0]) {
      const double u = (s - points[i - 1][0]) / (points[i][0] - points[i - 1][0]);
      return mix_of(points[i - 1][1], points[i][1], std::max(0.0, u));
    }
  }
  return points[N - 1][1];
}

/// A quadratic curve from `a` (s = 0) through `b` (s = 0.5) to `c` (s = 1).
Vector3d through(const Vector3d& a, const Vector3d& b, const Vector3d& c, double s) {
  const Vector3d control = 2 * b - 0.5 * (a + c);
  return (1 - s) * (1 - s) * a + 2 * s * (1 - s) * control + s * s * c;
}

/// A wave that moves along a cloth: `cycles` per period of the action.
double travelling(double seconds, int cycles, double along, double phase) {
  return std::sin(kTwoPi * (cycles * seconds / kActionPeriodSeconds - along) + phase);
}

void add_head(std::vector<Part>& parts, const Pose& pose) {
  const RigidTransform& head = pose.world_from_head;
  const Matrix3d& r = head.rotation;
  parts.push_back(
      make_ellipsoid(Material::kFace, head.translation, r, {0.098, 0.077, 0.118}, 48, 32));
  parts.push_back(make_ellipsoid(Material::kHair, head * Vector3d(-0.020, 0, 0.028), r,
                                 {0.096, 0.086, 0.100}, 40, 26));
  parts.push_back(make_ellipsoid(Material::kFace, head * Vector3d(0.098, 0, -0.012), r,
                                 {0.017, 0.013, 0.024}, 12, 10));
  for (const double side : {1.0, -1.0}) {
    parts.push_back(make_ellipsoid(Material::kSkin, head * Vector3d(-0.002, side * 0.080, -0.008),
                                   r, {0.018, 0.010, 0.030}, 12, 10));
  }
  // Topknot.
  parts.push_back(make_capsule(Material::kHair, head * Vector3d(-0.075, 0, 0.112),
                               head * Vector3d(-0.100, 0, 0.150), 0.024, 0.020, r.col(1)));
  parts.push_back(make_capsule(Material::kHair, head * Vector3d(-0.102, 0, 0.152),
                               head * Vector3d(-0.020, 0, 0.158), 0.021, 0.014, r.col(1)));
  parts.push_back(make_capsule(Material::kSkin, pose.world_from_chest * Vector3d(0, 0, -0.05),
                               head * Vector3d(-0.015, 0, -0.06), 0.060, 0.053, r.col(1), 1.0));
}

/// Body of the jacket, from the hips to the neck.
void add_torso(std::vector<Part>& parts, const Pose& pose, double seconds, uint64_t seed) {
  static constexpr double kHalfWidth[][2] = {{0, 0.165},    {0.2, 0.160},  {0.42, 0.150},
                                             {0.65, 0.172}, {0.82, 0.188}, {0.90, 0.165},
                                             {0.96, 0.115}, {1, 0.075}};
  static constexpr double kHalfDepth[][2] = {{0, 0.130},    {0.2, 0.125},  {0.42, 0.112},
                                             {0.65, 0.122}, {0.82, 0.112}, {0.90, 0.098},
                                             {0.96, 0.082}, {1, 0.066}};
  const RigidTransform& pelvis = pose.world_from_pelvis;
  const RigidTransform& chest = pose.world_from_chest;
  const Vector3d bottom = pelvis * Vector3d(0, 0, 0.02);
  const Vector3d top = chest * Vector3d(0, 0, 0.015);
  const Vector3d middle = 0.5 * (pelvis * Vector3d(0, 0, 0.22) + chest * Vector3d(0, 0, -0.25));
  const Eigen::Quaterniond from(pelvis.rotation);
  const Eigen::Quaterniond to(chest.rotation);
  constexpr int kRings = 36;
  std::vector<Ring> rings;
  for (int i = 0; i <= kRings; ++i) {
    const double s = static_cast<double>(i) / kRings;
    const Matrix3d frame = from.slerp(smooth(s), to).toRotationMatrix();
    rings.push_back({through(bottom, middle, top, s), profile(kHalfDepth, s) * frame.col(0),
                     profile(kHalfWidth, s) * frame.col(1), s * 0.56});
  }
  const double phase = kTwoPi * unit(mix(seed ^ 0x70));
  const auto folds = [&](int k, double angle) {
    const double s = static_cast<double>(k) / kRings;
    const double loose = smooth(s / 0.2) * smooth((0.95 - s) / 0.2);
    return 1 + loose * (0.020 * std::sin(5 * angle + 9 * s + phase) +
                        0.014 * travelling(seconds, 4, 1.6 * s, 3 * angle + phase));
  };
  parts.push_back(make_tube(Material::kJacket, rings, 56, folds, {0, 0, -0.01}, {0, 0, 0.01}));

  // The seat of the trousers connects the legs; the shoulders connect the sleeves.
  parts.push_back(make_ellipsoid(Material::kTrousers, pelvis * Vector3d(-0.005, 0, 0.03),
                                 pelvis.rotation, {0.142, 0.175, 0.150}, 48, 24));
  for (const Side side : {kLeft, kRight}) {
    parts.push_back(make_ellipsoid(Material::kJacket,
                                   0.90 * pose.arm[side].root + 0.10 * chest.translation,
                                   chest.rotation, {0.072, 0.074, 0.066}, 24, 16));
  }

  // Belt, outside the jacket.
  std::vector<Ring> belt;
  for (int i = 0; i <= 6; ++i) {
    const double s = 0.28 + 0.16 * i / 6;
    const Matrix3d frame = from.slerp(smooth(s), to).toRotationMatrix();
    const double bulge = 1.12 - 0.05 * std::pow((i - 3) / 3.0, 2);
    belt.push_back({through(bottom, middle, top, s), bulge * profile(kHalfDepth, s) * frame.col(0),
                    bulge * profile(kHalfWidth, s) * frame.col(1), s * 0.56});
  }
  parts.push_back(make_tube(
      Material::kBelt, belt, 48, [](int, double) { return 1.0; }, Vector3d::Zero(),
      Vector3d::Zero()));
}

void add_arm(std::vector<Part>& parts, const Pose& pose, Side side) {
  const Limb& arm = pose.arm[side];
  const Vector3d up = pose.world_from_chest.rotation.col(2) + 0.3 * Vector3d::UnitX();
  parts.push_back(
      make_capsule(Material::kSkin, 0.6 * arm.root + 0.4 * arm.joint, arm.joint, 0.046, 0.042, up));
  parts.push_back(make_capsule(Material::kSkin, arm.joint, arm.tip, 0.043, 0.028, up, 1.0, 20, 12));
  // The hand around the handle: fingers across it, thumb along it.
  const Matrix3d& sword = pose.world_from_sword.rotation;
  const double grip = grip_of(side);
  const Vector3d hold = pose.world_from_sword * Vector3d(0, 0, grip);
  parts.push_back(
      make_capsule(Material::kSkin, arm.tip, 0.35 * arm.tip + 0.65 * hold, 0.029, 0.038, up, 0.8));
  const Vector3d across = sword.col(1) * (side == kLeft ? 1 : -1);
  for (int finger = 0; finger < 4; ++finger) {
    const Vector3d knuckle =
        pose.world_from_sword * Vector3d(0.0, 0, grip - 0.036 + 0.024 * finger);
    parts.push_back(make_capsule(Material::kSkin, knuckle + 0.027 * across - 0.012 * sword.col(0),
                                 knuckle - 0.020 * across + 0.026 * sword.col(0), 0.0125, 0.0105,
                                 sword.col(2), 1.0, 10, 4));
  }
  parts.push_back(make_capsule(Material::kSkin, hold - 0.024 * across - 0.012 * sword.col(0),
                               hold - 0.026 * across + 0.045 * sword.col(2), 0.0125, 0.010,
                               sword.col(0), 1.0, 10, 4));
}

/// A wide sleeve, which hangs below the arm. Its hem lags behind the motion; its opening is a
/// shallow concavity.
void add_sleeve(std::vector<Part>& parts, const Motion& motion, double seconds, Side side,
                uint64_t seed) {
  constexpr int kRings = 30;
  constexpr int kInner = 5;  // rings inside the opening
  constexpr double kLag = 0.022;
  static constexpr double kAcross[][2] = {{0, 0.070}, {0.25, 0.080}, {0.6, 0.082}, {1, 0.088}};
  static constexpr double kDown[][2] = {{0, 0.078}, {0.25, 0.098}, {0.6, 0.128}, {1, 0.165}};
  const double phase = kTwoPi * unit(mix(seed ^ (0x51EE + static_cast<uint64_t>(side))));
  std::vector<Ring> rings;
  for (int i = 0; i <= kRings + kInner; ++i) {
    const bool inside = i > kRings;
    const double s = inside ? 1 - 0.05 * (i - kRings) : static_cast<double>(i) / kRings;
    const double narrower = inside ? 1 - 0.07 - 0.10 * (i - kRings) : 1;
    const Pose pose = pose_at(seconds - kLag * s * s, motion);
    const Limb& arm = pose.arm[side];
    const Vector3d elbow = arm.joint;
    const Vector3d start =
        arm.root + 0.04 * (pose.world_from_chest.translation - arm.root).normalized();
    const Vector3d end = elbow + 0.62 * (arm.tip - elbow);
    const Vector3d center = through(start, 0.85 * elbow + 0.15 * arm.root, end, s);
    const Vector3d ahead = through(start, 0.85 * elbow + 0.15 * arm.root, end, s + 0.01);
    const Vector3d axis = (ahead - center).normalized();
    // Downwards, perpendicular to the arm; away from the body where the arm points down.
    const Vector3d heading = pose.world_from_chest.rotation.col(0);
    const Vector3d hang = -Vector3d::UnitZ() - 0.35 * heading;
    const Vector3d down = (hang - hang.dot(axis) * axis).normalized();
    const double swing = 0.012 * s * travelling(seconds, 5, 0.7 * s, phase);
    const double drop = profile(kDown, s) - 0.072;
    rings.push_back({center + drop * down + swing * axis.cross(down),
                     narrower * profile(kDown, s) * down,
                     narrower * profile(kAcross, s) * axis.cross(down), s * 0.45});
  }
  const auto folds = [&](int k, double angle) {
    const double s = std::min(1.0, static_cast<double>(k) / kRings);
    return 1 + s * (0.055 * std::sin(4 * angle + 7 * s + phase) * (0.6 + 0.4 * std::cos(angle)) +
                    0.050 * travelling(seconds, 6, 1.3 * s, 2 * angle + phase));
  };
  const Vector3d back = rings[kRings - 4].center - rings[kRings].center;
  parts.push_back(make_tube(Material::kJacket, rings, 48, folds,
                            0.1 * (rings[0].center - rings[4].center), 0.15 * back));
  parts.back().is_sleeve = true;
}

/// One leg of the loose trousers, with pleats that widen towards the hem and waves that move down.
/// The hem lags behind the leg.
void add_trouser_leg(std::vector<Part>& parts, const Motion& motion, double seconds, Side side,
                     uint64_t seed) {
  constexpr int kRings = 48;
  constexpr int kInner = 4;
  constexpr double kLag = 0.05;
  static constexpr double kWidth[][2] = {{0, 0.105}, {0.15, 0.135}, {0.5, 0.158}, {1, 0.195}};
  static constexpr double kDepth[][2] = {{0, 0.140}, {0.15, 0.150}, {0.5, 0.165}, {1, 0.205}};
  const double sign = side == kLeft ? 1 : -1;
  const double phase = kTwoPi * unit(mix(seed ^ (0x1E6 + static_cast<uint64_t>(side))));
  std::vector<Ring> rings;
  for (int i = 0; i <= kRings + kInner; ++i) {
    const bool inside = i > kRings;
    const double s = inside ? 1 - 0.012 * (i - kRings) : static_cast<double>(i) / kRings;
    const double narrower = inside ? 1 - 0.06 - 0.14 * (i - kRings) : 1;
    const Pose pose = pose_at(seconds - kLag * s * s, motion);
    const Limb& leg = pose.leg[side];
    const Matrix3d& pelvis = pose.world_from_pelvis.rotation;
    const Vector3d forward = Vector3d(pelvis(0, 0), pelvis(1, 0), 0).normalized();
    const Vector3d left = Vector3d::UnitZ().cross(forward);
    const Vector3d top = pose.world_from_pelvis * Vector3d(0, sign * 0.062, 0.10);
    const Vector3d hem = leg.tip + Vector3d(0, 0, 0.045) - 0.02 * forward + 0.01 * sign * left;
    const Vector3d knee = leg.joint + 0.015 * sign * left - 0.035 * forward;
    const Vector3d sway = 0.018 * s * s *
                          (travelling(seconds, 5, 0.9 * s, phase) * forward +
                           travelling(seconds, 4, 0.8 * s, phase + 1) * left);
    rings.push_back({through(top, knee, hem, s) + sway, narrower * profile(kDepth, s) * forward,
                     -narrower * profile(kWidth, s) * left, s * 0.92});
  }
  const auto folds = [&](int k, double angle) {
    const double s = std::min(1.0, static_cast<double>(k) / kRings);
    const double pleat = std::sin(9 * angle + phase);
    return 1 + smooth(s / 0.15) * (0.030 + 0.065 * s) * pleat +
           s * 0.050 * travelling(seconds, 6, 1.5 * s, 3 * angle + phase) +
           s * s * 0.035 * travelling(seconds, 9, 2.3 * s, -2 * angle + phase);
  };
  parts.push_back(make_tube(Material::kTrousers, rings, 90, folds, {0, 0, 0.01}, {0, 0, 0.02}));
}

void add_leg(std::vector<Part>& parts, const Pose& pose, Side side) {
  const Limb& leg = pose.leg[side];
  const Matrix3d& foot = pose.foot[side];
  parts.push_back(make_capsule(Material::kSkin, leg.joint, leg.tip, 0.055, 0.040, foot.col(0)));
  const Vector3d heel = leg.tip + foot * Vector3d(-0.045, 0, -0.040);
  const Vector3d ball = leg.tip + foot * Vector3d(0.125, 0, -0.047);
  parts.push_back(
      make_capsule(Material::kSock, heel, ball, 0.036, 0.027, foot.col(2), 1.35, 24, 10));
  parts.push_back(make_capsule(Material::kSock, leg.tip + foot * Vector3d(0, 0, 0.03),
                               leg.tip + foot * Vector3d(0.07, 0, -0.035), 0.040, 0.030,
                               foot.col(1), 1.0));
  for (int toe = 0; toe < 2; ++toe) {
    const double aside = (toe == 0 ? 0.020 : -0.014) * (side == kLeft ? -1 : 1);
    parts.push_back(make_capsule(Material::kSock, ball + foot * Vector3d(-0.02, aside, -0.004),
                                 ball + foot * Vector3d(0.045, aside, -0.011), 0.020,
                                 toe == 0 ? 0.015 : 0.014, foot.col(2), toe == 0 ? 1.0 : 1.4, 14,
                                 4));
  }
}

Part blade_of(const Pose& pose) {
  constexpr int kRings = 44;
  constexpr double kCurve = 0.020;  // curvature: offset of the tip along -x, metres
  const RigidTransform& sword = pose.world_from_sword;
  std::vector<Ring> rings;
  for (int i = 0; i <= kRings; ++i) {
    const double s = static_cast<double>(i) / kRings;
    const double taper = std::sqrt(std::max(0.0, 1 - std::pow(std::max(0.0, s - 0.90) / 0.105, 2)));
    const Vector3d center = sword * Vector3d(-kCurve * s * s, 0, s * (kBladeLength - 0.002));
    rings.push_back({center, 0.0150 * taper * sword.rotation.col(0),
                     0.0125 * taper * sword.rotation.col(1), s * kBladeLength});
  }
  return make_tube(
      Material::kBlade, rings, 16, [](int, double) { return 1.0; }, Vector3d::Zero(),
      0.002 * sword.rotation.col(2));
}

void add_sword(std::vector<Part>& parts, const Pose& pose) {
  const RigidTransform& sword = pose.world_from_sword;
  const Matrix3d& r = sword.rotation;
  parts.push_back(make_capsule(Material::kHandle, sword * Vector3d(0, 0, -kHandleLength),
                               sword * Vector3d(0, 0, 0), 0.0185, 0.0170, r.col(0), 0.85, 20, 24));
  parts.push_back(
      make_ellipsoid(Material::kGuard, sword.translation, r, {0.042, 0.040, 0.008}, 32, 8));
}

}  // namespace

std::vector<Performer> cast_of(int performers) {
  V3D_CHECK(performers == 1 || performers == 2);
  if (performers == 1) return {Performer{}};
  constexpr double kHalfDistance = 0.80;
  return {{{Action::kAttack, {-kHalfDistance, 0}, 0}, Palette::kIndigo},
          {{Action::kDefence, {kHalfDistance, 0}, 180}, Palette::kPlum}};
}

std::vector<Part> performer_parts(double seconds, uint64_t seed, const Performer& performer) {
  if (performer.model) return performer.model->parts_at(seconds);
  const Motion& motion = performer.motion;
  const Pose pose = pose_at(seconds, motion);
  std::vector<Part> parts;
  add_head(parts, pose);
  add_torso(parts, pose, seconds, seed);
  for (const Side side : {kLeft, kRight}) {
    add_arm(parts, pose, side);
    add_sleeve(parts, motion, seconds, side, seed);
    add_leg(parts, pose, side);
    add_trouser_leg(parts, motion, seconds, side, seed);
  }
  add_sword(parts, pose);
  parts.push_back(blade_of(pose));
  for (Part& part : parts) part.palette = performer.palette;
  return parts;
}

Part sword_blade(double seconds, const Performer& performer) {
  if (performer.model) return {};
  Part blade = blade_of(pose_at(seconds, performer.motion));
  blade.palette = performer.palette;
  return blade;
}

Mesh performer_at(double seconds, uint64_t seed) {
  Mesh all;
  for (const Part& part : performer_parts(seconds, seed)) {
    const auto first = static_cast<uint32_t>(all.vertices.size());
    std::ranges::copy(part.mesh.vertices, std::back_inserter(all.vertices));
    for (const auto& t : part.mesh.triangles) {
      all.triangles.push_back({t[0] + first, t[1] + first, t[2] + first});
    }
    for (const Eigen::Vector3f& place : part.paint) {
      const Eigen::Vector3f colour = 255.0F * paint(part.material, place, seed);
      const auto byte = [](float v) {
        return static_cast<uint8_t>(std::clamp(v + 0.5F, 0.0F, 255.0F));
      };
      all.colours.push_back({byte(colour.x()), byte(colour.y()), byte(colour.z())});
    }
  }
  return all;
}

}  // namespace v3d::sim
