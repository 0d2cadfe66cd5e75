#include "sim/performer/joints.h"

#include <algorithm>
#include <cctype>
#include <iterator>

#include "sim/performer/motion.h"
#include "sim/performer/performer.h"
#include "sim/performer/skinned_model.h"

namespace v3d::sim {
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

std::vector<Joint> joints_of(const Performer& performer) {
  if (performer.model) return performer.model->joints();
  std::vector<Joint> joints;
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
