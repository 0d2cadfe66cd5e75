// Skeletons of performers: nodes that an animation moves, and joints.
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <array>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace v3d::sim {

// A skeleton of nodes that an animation moves, as in glTF 2.0.

/// Values of one property of a node over time.
template <class Value>
struct AnimationTrack {
  std::vector<double> seconds;  ///< ascending
  std::vector<Value> values;    ///< one per time; none: the property does not change
  bool steps = false;           ///< the value stays until the next time, instead of a linear change
};

/// A node of a skeleton: its transform relative to its parent, at rest and animated.
struct SkeletonNode {
  std::string name;
  int parent = -1;  ///< index of another node; -1: none
  Eigen::Vector3d translation = Eigen::Vector3d::Zero();
  Eigen::Quaterniond rotation = Eigen::Quaterniond::Identity();
  Eigen::Vector3d scale = Eigen::Vector3d::Ones();
  std::optional<Eigen::Affine3d> matrix;  ///< instead of the three; such a node has no tracks
  AnimationTrack<Eigen::Vector3d> translations, scales;
  AnimationTrack<Eigen::Quaterniond> rotations;
};

/// The poses of a skeleton at all times. Axes and unit are those of the file, with y up.
///
/// The animation repeats. Its period is the time from the first key to the last one. Where the last
/// value of a property differs from the first one, the last 0.2 s lead to the first value: the
/// difference is added with a weight that increases smoothly from 0 to 1. In an animation of less
/// than 0.4 s this takes half of the period.
///
/// The animation is in place: the horizontal distance that a root travels in a period is removed,
/// in proportion to the time.
///
/// Immutable; any thread.
class AnimatedSkeleton {
 public:
  /// `body`: a node that moves with the body; the travel of this node and of its ancestors is
  /// removed. Requires a forest, valid indices, and times that ascend.
  AnimatedSkeleton(std::vector<SkeletonNode> nodes, size_t body);

  const std::vector<SkeletonNode>& nodes() const { return nodes_; }
  /// 0 for an animation of one key.
  double period_s() const { return last_s_ - first_s_; }
  /// model_from_node of each node. `seconds`: any time since the first key.
  std::vector<Eigen::Affine3d> transforms(double seconds) const;

 private:
  void find_order();
  void find_period();
  void remove_travel(size_t node);
  double blend_weight(double time) const;
  template <class Value>
  Value value_at(const AnimationTrack<Value>& track, const Value& rest, double time) const;
  Eigen::Affine3d parent_from_node(const SkeletonNode& node, double time) const;

  std::vector<SkeletonNode> nodes_;
  std::vector<size_t> order_;  ///< parents come before their children
  double first_s_ = 0, last_s_ = 0;
};

// Joints of performers: the truth for skeletons.

struct Performer;

struct JointDefinition {
  std::string name;
  int parent = -1;   ///< index of another joint; -1: none
  std::string main;  ///< its name in kMainJoints; empty where it has none
};

/// The joints that all performers have, with names that do not depend on the skeleton.
inline constexpr std::array<std::string_view, 15> kMainJoints = {
    "pelvis",     "neck",        "head",       "left_shoulder", "right_shoulder",
    "left_elbow", "right_elbow", "left_wrist", "right_wrist",   "left_hip",
    "right_hip",  "left_knee",   "right_knee", "left_ankle",    "right_ankle"};

/// The main joint of a node with this name in a file; empty where there is none. Supports the names
/// of Mixamo (`mixamorig:LeftForeArm`), VRM (`leftLowerArm`) and Blender (`forearm.L`).
std::string main_joint_of(std::string_view node);

/// The joints of a performer: those of Pose, the guard and the tip of the sword, all in metres; or
/// the nodes of the skin of its model.
std::vector<JointDefinition> joints_of(const Performer& performer);

/// The positions of joints_of() in its order: world frame, metres.
std::vector<Eigen::Vector3d> joint_positions(double seconds, const Performer& performer);

}  // namespace v3d::sim
