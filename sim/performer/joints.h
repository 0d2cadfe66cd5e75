// Joints of performers: the truth for skeletons.
#pragma once

#include <Eigen/Core>
#include <array>
#include <string>
#include <string_view>
#include <vector>

namespace v3d::sim {

struct Performer;

struct Joint {
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
std::vector<Joint> joints_of(const Performer& performer);

/// The positions of joints_of() in its order: world frame, metres.
std::vector<Eigen::Vector3d> joint_positions(double seconds, const Performer& performer);

}  // namespace v3d::sim
