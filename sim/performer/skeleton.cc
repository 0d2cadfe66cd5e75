#include "sim/performer/skeleton.h"

#include <algorithm>
#include <cctype>
#include <cmath>
#include <iterator>
#include <limits>

#include "base/core/error.h"
#include "sim/performer/motion.h"
#include "sim/performer/performer.h"
#include "sim/performer/skinned_model.h"

namespace v3d::sim {
namespace {

using Eigen::Affine3d;
using Eigen::Quaterniond;
using Eigen::Vector3d;

constexpr double kBlendSeconds = 0.2;

Vector3d between(const Vector3d& a, const Vector3d& b, double share) { return a + share * (b - a); }
Quaterniond between(const Quaterniond& a, const Quaterniond& b, double share) {
  return a.slerp(share, b);
}

/// `value` changed by a share of the difference between `last` and `first`.
Vector3d towards(const Vector3d& value, const Vector3d& last, const Vector3d& first, double share) {
  return value + share * (first - last);
}
Quaterniond towards(const Quaterniond& value, const Quaterniond& last, const Quaterniond& first,
                    double share) {
  return value * Quaterniond::Identity().slerp(share, last.conjugate() * first);
}

/// The value at a time; the first or last value before or after all keys. Requires a value.
template <class Value>
Value interpolate(const AnimationTrack<Value>& track, double time) {
  const auto after =
      static_cast<size_t>(std::ranges::upper_bound(track.seconds, time) - track.seconds.begin());
  if (after == 0) return track.values.front();
  if (after == track.seconds.size() || track.steps) return track.values[after - 1];
  const double begin = track.seconds[after - 1], end = track.seconds[after];
  return between(track.values[after - 1], track.values[after], (time - begin) / (end - begin));
}

}  // namespace

AnimatedSkeleton::AnimatedSkeleton(std::vector<SkeletonNode> nodes, size_t body)
    : nodes_(std::move(nodes)) {
  V3D_CHECK(body < nodes_.size());
  find_order();
  find_period();
  for (int node = static_cast<int>(body); node >= 0;) {
    remove_travel(static_cast<size_t>(node));
    node = nodes_[static_cast<size_t>(node)].parent;
  }
}

void AnimatedSkeleton::find_order() {
  std::vector<bool> known(nodes_.size(), false);
  std::vector<size_t> open;
  for (size_t n = 0; n < nodes_.size(); ++n) {
    for (size_t at = n; !known[at]; at = static_cast<size_t>(nodes_[at].parent)) {
      known[at] = true;
      open.push_back(at);
      if (nodes_[at].parent < 0) break;
    }
    order_.insert(order_.end(), open.rbegin(), open.rend());
    open.clear();
  }
}

void AnimatedSkeleton::find_period() {
  double first = std::numeric_limits<double>::infinity(), last = -first;
  const auto add = [&](const std::vector<double>& times) {
    if (times.empty()) return;
    first = std::min(first, times.front());
    last = std::max(last, times.back());
  };
  for (const SkeletonNode& node : nodes_) {
    add(node.translations.seconds);
    add(node.rotations.seconds);
    add(node.scales.seconds);
  }
  if (last < first) return;
  first_s_ = first;
  last_s_ = last;
}

void AnimatedSkeleton::remove_travel(size_t node) {
  AnimationTrack<Vector3d>& track = nodes_[node].translations;
  if (track.values.size() < 2) return;
  Eigen::Matrix3d model_from_parent = Eigen::Matrix3d::Identity();
  if (nodes_[node].parent >= 0) {
    model_from_parent = transforms(0)[static_cast<size_t>(nodes_[node].parent)].linear();
  }
  if (!(std::abs(model_from_parent.determinant()) > 0)) return;
  Vector3d travel = model_from_parent * (track.values.back() - track.values.front());
  travel.y() = 0;  // up
  const Vector3d in_parent = model_from_parent.inverse() * travel;
  const double begin = track.seconds.front(), end = track.seconds.back();
  for (size_t i = 0; i < track.values.size(); ++i) {
    track.values[i] -= (track.seconds[i] - begin) / (end - begin) * in_parent;
  }
}

double AnimatedSkeleton::blend_weight(double time) const {
  const double duration = std::min(kBlendSeconds, 0.5 * period_s());
  if (duration <= 0) return 0;
  const double s = std::clamp(1 - (last_s_ - time) / duration, 0.0, 1.0);
  return s * s * (3 - 2 * s);
}

template <class Value>
Value AnimatedSkeleton::value_at(const AnimationTrack<Value>& track, const Value& rest,
                                 double time) const {
  if (track.values.empty()) return rest;
  const Value value = interpolate(track, time);
  const double weight = blend_weight(time);
  if (track.steps || weight <= 0) return value;
  return towards(value, interpolate(track, last_s_), interpolate(track, first_s_), weight);
}

Affine3d AnimatedSkeleton::parent_from_node(const SkeletonNode& node, double time) const {
  if (node.matrix) return *node.matrix;
  Affine3d transform = Affine3d::Identity();
  transform.translate(value_at(node.translations, node.translation, time));
  transform.rotate(value_at(node.rotations, node.rotation, time).normalized());
  transform.scale(value_at(node.scales, node.scale, time));
  return transform;
}

std::vector<Affine3d> AnimatedSkeleton::transforms(double seconds) const {
  const double laps = period_s() > 0 ? std::floor(seconds / period_s()) : 0;
  const double time = first_s_ + seconds - laps * period_s();
  std::vector<Affine3d> model_from_node(nodes_.size());
  for (const size_t n : order_) {
    const SkeletonNode& node = nodes_[n];
    model_from_node[n] = parent_from_node(node, time);
    if (node.parent < 0) continue;
    model_from_node[n] = model_from_node[static_cast<size_t>(node.parent)] * model_from_node[n];
  }
  return model_from_node;
}

namespace {

/// Names of nodes in lower case, without prefix and punctuation.
struct NodeNames {
  std::string_view main;
  std::array<std::string_view, 3> nodes;
};
constexpr NodeNames kNodeNames[] = {
    {"pelvis", {"hips", "pelvis", ""}},
    {"neck", {"neck", "neck1", ""}},
    {"head", {"head", "", ""}},
    {"left_shoulder", {"leftarm", "leftupperarm", "upperarml"}},
    {"right_shoulder", {"rightarm", "rightupperarm", "upperarmr"}},
    {"left_elbow", {"leftforearm", "leftlowerarm", "forearml"}},
    {"right_elbow", {"rightforearm", "rightlowerarm", "forearmr"}},
    {"left_wrist", {"lefthand", "handl", ""}},
    {"right_wrist", {"righthand", "handr", ""}},
    {"left_hip", {"leftupleg", "leftupperleg", "thighl"}},
    {"right_hip", {"rightupleg", "rightupperleg", "thighr"}},
    {"left_knee", {"leftleg", "leftlowerleg", "shinl"}},
    {"right_knee", {"rightleg", "rightlowerleg", "shinr"}},
    {"left_ankle", {"leftfoot", "footl", ""}},
    {"right_ankle", {"rightfoot", "footr", ""}},
};

/// A joint of the performer with a sword.
struct BuiltInJoint {
  const char* name;
  int parent;
};
constexpr BuiltInJoint kSwordsman[] = {
    {"pelvis", -1},        {"neck", 0},        {"head", 1},         {"left_shoulder", 1},
    {"right_shoulder", 1}, {"left_elbow", 3},  {"right_elbow", 4},  {"left_wrist", 5},
    {"right_wrist", 6},    {"left_hip", 0},    {"right_hip", 0},    {"left_knee", 9},
    {"right_knee", 10},    {"left_ankle", 11}, {"right_ankle", 12}, {"sword_guard", 8},
    {"sword_tip", 15}};

}  // namespace

std::string main_joint_of(std::string_view node) {
  std::string name;
  for (const char c : node.substr(node.rfind(':') + 1)) {  // npos + 1 is 0
    const auto letter = static_cast<unsigned char>(c);
    if (std::isalnum(letter) != 0) name += static_cast<char>(std::tolower(letter));
  }
  if (name.empty()) return {};
  for (const NodeNames& entry : kNodeNames) {
    if (std::ranges::find(entry.nodes, name) != entry.nodes.end()) return std::string(entry.main);
  }
  return {};
}

std::vector<JointDefinition> joints_of(const Performer& performer) {
  if (performer.model) return performer.model->joints();
  std::vector<JointDefinition> joints;
  for (const BuiltInJoint& joint : kSwordsman) {
    const bool is_main = std::ranges::find(kMainJoints, joint.name) != kMainJoints.end();
    joints.push_back({joint.name, joint.parent, is_main ? joint.name : ""});
  }
  return joints;
}

std::vector<Eigen::Vector3d> joint_positions(double seconds, const Performer& performer) {
  if (performer.model) return performer.model->joint_positions(seconds);
  const Pose pose = pose_at(seconds, performer.motion);
  const auto& [left_arm, right_arm] = pose.arm;
  const auto& [left_leg, right_leg] = pose.leg;
  return {pose.world_from_pelvis.translation,
          pose.world_from_chest.translation,
          pose.world_from_head.translation,
          left_arm.root,
          right_arm.root,
          left_arm.joint,
          right_arm.joint,
          left_arm.tip,
          right_arm.tip,
          left_leg.root,
          right_leg.root,
          left_leg.joint,
          right_leg.joint,
          left_leg.tip,
          right_leg.tip,
          pose.world_from_sword.translation,
          sword_tip(pose)};
}

}  // namespace v3d::sim
