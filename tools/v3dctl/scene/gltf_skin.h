// Skins of glTF 2.0 models: places the vertices by the joints as they stand in the file.
#pragma once

#include <Eigen/Geometry>
#include <cstdint>
#include <map>
#include <string>
#include <vector>

#include "gltf/gltf_file.h"

namespace v3d::ctl {

/// Skins of one file, each read once. One thread.
class GltfSkins {
 public:
  /// For each joint of a skin: from the mesh to the axes of the result.
  using Joints = std::vector<Eigen::Affine3f>;

  /// `file` is borrowed. `up`: from the axes of the file to those of the result.
  GltfSkins(GltfFile& file, const Eigen::Affine3f& up);

  /// Throws InputError for a skin that does not exist or is damaged, and for one whose joints
  /// together with those of the skins before it exceed 10,000.
  const Joints& joints(int skin);

 private:
  Joints read(int skin);
  Eigen::Affine3f from_node(int node) const;

  GltfFile& file_;
  const Eigen::Affine3f up_;
  std::vector<int> parents_;  ///< of every node; -1: a root
  std::map<int, Joints> skins_;
  size_t count_ = 0;  ///< joints of `skins_`
};

/// The skin of the vertices of a primitive: JOINTS_0 and WEIGHTS_0. Further sets are ignored, as
/// three.js does.
class VertexSkin {
 public:
  /// `joints` is borrowed. `where`: the primitive, for messages. Throws InputError for attributes
  /// that are missing or damaged.
  VertexSkin(GltfFile& file, const tinygltf::Primitive& primitive, const GltfSkins::Joints& joints,
             size_t vertices, const std::string& where);

  /// The mean of the transforms of a vertex' joints by their weights, whose sum becomes 1.
  Eigen::Affine3f at(size_t vertex) const;

 private:
  const GltfSkins::Joints& joints_;
  std::vector<uint32_t> numbers_;  ///< four a vertex
  std::vector<float> weights_;     ///< four a vertex
};

}  // namespace v3d::ctl
