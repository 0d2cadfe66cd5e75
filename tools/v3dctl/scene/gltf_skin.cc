#include "v3dctl/scene/gltf_skin.h"

#include <algorithm>

namespace v3d::ctl {
namespace {

constexpr size_t kMaxJoints = 10'000;  ///< of all skins of a file
constexpr size_t kPerVertex = 4;       ///< joints

std::string at(const std::string& list, int n) { return list + "[" + std::to_string(n) + "]"; }

}  // namespace

GltfSkins::GltfSkins(GltfFile& file, const Eigen::Affine3f& up)
    : file_(file), up_(up), parents_(file.model().nodes.size(), -1) {
  for (size_t n = 0; n < parents_.size(); ++n) {
    for (const int child : file.model().nodes[n].children) {
      file.of(file.model().nodes, child);
      parents_[static_cast<size_t>(child)] = static_cast<int>(n);
    }
  }
}

const GltfSkins::Joints& GltfSkins::joints(int skin) {
  const auto known = skins_.find(skin);
  return known != skins_.end() ? known->second : skins_.emplace(skin, read(skin)).first->second;
}

GltfSkins::Joints GltfSkins::read(int index) {
  const tinygltf::Skin& skin = file_.of(file_.model().skins, index);
  const std::string where = at("skins", index);
  if (skin.joints.empty()) file_.fail(where + " has no joints; expected one or more");
  count_ += skin.joints.size();
  if (count_ > kMaxJoints) file_.fail(where + ": more than 10,000 joints together");
  std::vector<float> matrices;
  if (skin.inverseBindMatrices >= 0) {
    matrices = file_.numbers(skin.inverseBindMatrices, 16, where + ".inverseBindMatrices", "joint");
    if (matrices.size() < 16 * skin.joints.size()) {
      file_.fail(where + ".inverseBindMatrices: " + std::to_string(matrices.size() / 16) + " for " +
                 std::to_string(skin.joints.size()) + " joints; expected one each");
    }
  }
  Joints result;
  for (size_t j = 0; j < skin.joints.size(); ++j) {
    file_.of(file_.model().nodes, skin.joints[j]);
    Eigen::Affine3f joint_from_mesh = Eigen::Affine3f::Identity();
    if (!matrices.empty()) {
      joint_from_mesh.matrix() = Eigen::Map<const Eigen::Matrix4f>(&matrices[16 * j]);
      joint_from_mesh.makeAffine();
    }
    result.push_back(from_node(skin.joints[j]) * joint_from_mesh);
  }
  return result;
}

/// check_gltf() has checked that the nodes are trees, and limits their depth.
Eigen::Affine3f GltfSkins::from_node(int node) const {
  Eigen::Affine3f result = Eigen::Affine3f::Identity();
  for (int n = node; n >= 0; n = parents_[static_cast<size_t>(n)]) {
    const tinygltf::Node& above = file_.of(file_.model().nodes, n);
    result = transform_of(above).parent_from_node().cast<float>() * result;
  }
  return up_ * result;
}

VertexSkin::VertexSkin(GltfFile& file, const tinygltf::Primitive& primitive,
                       const GltfSkins::Joints& joints, size_t vertices, const std::string& where)
    : joints_(joints) {
  const auto accessor = [&](const char* name) {
    const auto found = primitive.attributes.find(name);
    if (found != primitive.attributes.end()) return found->second;
    file.fail(where + ": has no " + name + ", but a node shows it with a skin");
  };
  numbers_ = file.integers(accessor("JOINTS_0"), kPerVertex, where + ": JOINTS_0");
  weights_ = file.numbers(accessor("WEIGHTS_0"), kPerVertex, where + ": WEIGHTS_0");
  if (numbers_.size() != kPerVertex * vertices || weights_.size() != kPerVertex * vertices) {
    file.fail(where + ": expected JOINTS_0 and WEIGHTS_0 for each of its " +
              std::to_string(vertices) + " vertices");
  }
  for (size_t n = 0; n < numbers_.size(); ++n) {
    if (weights_[n] < 0) file.fail(where + ": has a weight below 0; expected 0 to 1");
    if (weights_[n] == 0 || numbers_[n] < joints.size()) continue;
    file.fail(where + ": vertex " + std::to_string(n / kPerVertex) + " names joint " +
              std::to_string(numbers_[n]) + "; the skin has " + std::to_string(joints.size()) +
              ", from 0");
  }
}

Eigen::Affine3f VertexSkin::at(size_t vertex) const {
  Eigen::Matrix<float, 3, 4> sum = Eigen::Matrix<float, 3, 4>::Zero();
  float weights = 0;
  for (size_t n = kPerVertex * vertex; n < kPerVertex * (vertex + 1); ++n) {
    if (weights_[n] == 0) continue;
    sum += weights_[n] * joints_[numbers_[n]].matrix().topRows<3>();
    weights += weights_[n];
  }
  if (weights == 0) {  // as in three.js
    return joints_[std::min<size_t>(numbers_[kPerVertex * vertex], joints_.size() - 1)];
  }
  Eigen::Affine3f transform = Eigen::Affine3f::Identity();
  transform.matrix().topRows<3>() = sum / weights;
  return transform;
}

}  // namespace v3d::ctl
