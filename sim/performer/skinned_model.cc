#include "sim/performer/skinned_model.h"

#include <algorithm>
#include <cctype>
#include <cmath>
#include <map>
#include <string>
#include <string_view>
#include <tuple>
#include <utility>

#include "base/core/error.h"
#include "base/core/union_find.h"

namespace v3d::sim {
namespace {

using Eigen::Vector3f;
using Triangles = std::vector<std::array<uint32_t, 3>>;

/// By vertex the first vertex at the same position.
std::vector<uint32_t> first_at_position(std::span<const Vector3f> positions) {
  std::map<std::tuple<float, float, float>, uint32_t> known;
  std::vector<uint32_t> first;
  for (const Vector3f& p : positions) {
    const auto index = static_cast<uint32_t>(first.size());
    first.push_back(known.emplace(std::tuple(p.x(), p.y(), p.z()), index).first->second);
  }
  return first;
}

/// The holes, each as the ring of its vertices in the direction of the triangles. At each vertex as
/// many edges without an opposite edge begin as end, so that rings close.
std::vector<std::vector<uint32_t>> holes_of(const Triangles& triangles) {
  std::map<std::pair<uint32_t, uint32_t>, int> single;  // edges without an opposite edge
  for (const auto& t : triangles) {
    for (size_t k = 0; k < 3; ++k) {
      const uint32_t a = t[k], b = t[(k + 1) % 3];
      const auto opposite = single.find({b, a});
      if (opposite == single.end()) {
        ++single[{a, b}];
      } else if (--opposite->second == 0) {
        single.erase(opposite);
      }
    }
  }
  std::multimap<uint32_t, uint32_t> next;
  for (const auto& [edge, count] : single) {
    for (int n = 0; n < count; ++n) next.insert(edge);
  }
  std::vector<std::vector<uint32_t>> holes;
  while (!next.empty()) {
    std::vector<uint32_t>& ring = holes.emplace_back();
    auto edge = next.begin();
    do {
      ring.push_back(edge->first);
      const uint32_t to = edge->second;
      next.erase(edge);
      edge = to == ring.front() ? next.end() : next.find(to);
    } while (edge != next.end());
  }
  return holes;
}

ClosedSurface closed(const Triangles& triangles) {
  ClosedSurface surface;
  std::map<uint32_t, uint32_t> index;
  for (const auto& triangle : triangles) {
    std::array<uint32_t, 3> corners{};
    for (size_t k = 0; k < 3; ++k) {
      const auto [at, is_new] =
          index.emplace(triangle[k], static_cast<uint32_t>(surface.sources.size()));
      if (is_new) surface.sources.push_back(triangle[k]);
      corners[k] = at->second;
    }
    surface.triangles.push_back(corners);
  }
  surface.holes = holes_of(surface.triangles);
  auto middle = static_cast<uint32_t>(surface.sources.size());
  for (const std::vector<uint32_t>& ring : surface.holes) {
    for (size_t k = 0; k < ring.size(); ++k) {
      surface.triangles.push_back({ring[(k + 1) % ring.size()], ring[k], middle});
    }
    ++middle;
  }
  return surface;
}

}  // namespace

void ClosedSurface::add_middles(std::vector<Vector3f>& values) const {
  for (const std::vector<uint32_t>& ring : holes) {
    Vector3f sum = Vector3f::Zero();
    for (const uint32_t v : ring) sum += values[v];
    values.push_back(sum / static_cast<float>(ring.size()));
  }
}

std::vector<ClosedSurface> closed_surfaces(std::span<const Vector3f> positions,
                                           std::span<const std::array<uint32_t, 3>> triangles) {
  const std::vector<uint32_t> first = first_at_position(positions);
  Triangles welded;
  UnionFind sets;
  sets.reset(positions.size());
  for (const auto& t : triangles) {
    const std::array<uint32_t, 3> corners = {first[t[0]], first[t[1]], first[t[2]]};
    const auto [a, b, c] = corners;
    if (a == b || b == c || c == a) continue;
    sets.unite(a, b);
    sets.unite(b, c);
    welded.push_back(corners);
  }
  std::map<uint32_t, Triangles> connected;
  for (const auto& triangle : welded) connected[sets.find(triangle[0])].push_back(triangle);
  std::vector<ClosedSurface> surfaces;
  for (const auto& [set, own] : connected) surfaces.push_back(closed(own));
  return surfaces;
}

namespace {

using Eigen::Affine3d;
using Eigen::Quaterniond;
using Eigen::Vector3d;

/// Times of the animation at which the extent of the body is measured.
constexpr double kSamplesPerSecond = 30;
constexpr int kMaxSamples = 150;

struct MaterialOfJoint {
  std::string_view name;  ///< part of the name of a node, in lower case
  Material material;
};
constexpr MaterialOfJoint kMaterials[] = {
    {"head", Material::kSkin},      {"neck", Material::kSkin},     {"hand", Material::kSkin},
    {"finger", Material::kSkin},    {"thumb", Material::kSkin},    {"foot", Material::kSock},
    {"toe", Material::kSock},       {"leg", Material::kTrousers},  {"hips", Material::kTrousers},
    {"thigh", Material::kTrousers}, {"shin", Material::kTrousers}, {"pelvis", Material::kTrousers}};

Material material_of(std::string joint) {
  std::ranges::transform(joint, joint.begin(), [](unsigned char c) { return std::tolower(c); });
  for (const auto& [name, material] : kMaterials) {
    if (joint.find(name) != std::string::npos) return material;
  }
  return Material::kJacket;
}

/// The factor by which a transform scales lengths.
double scale_of(const Affine3d& transform) {
  return std::cbrt(std::abs(transform.linear().determinant()));
}

/// The first joint that has no other joint above it.
size_t root_of(const SkinnedBody& body) {
  V3D_CHECK(!body.joints.empty());
  std::vector<bool> is_joint(body.nodes.size(), false);
  for (const SkinJoint& joint : body.joints) is_joint[joint.node] = true;
  size_t root = body.joints[0].node;
  for (int up = body.nodes[root].parent; up >= 0; up = body.nodes[static_cast<size_t>(up)].parent) {
    if (is_joint[static_cast<size_t>(up)]) root = static_cast<size_t>(up);
  }
  return root;
}

}  // namespace

SkinnedModel::SkinnedModel(SkinnedBody body)
    : joints_(body.joints),
      positions_(std::move(body.positions)),
      weights_(std::move(body.weights)),
      skeleton_(body.nodes, root_of(body)) {
  // The root comes first.
  joint_nodes_.push_back(root_of(body));
  for (const SkinJoint& joint : joints_) {
    if (std::ranges::find(joint_nodes_, joint.node) == joint_nodes_.end()) {
      joint_nodes_.push_back(joint.node);
    }
  }
  world_from_model_.linear() << 0, 0, 1, 1, 0, 0, 0, 1, 0;  // y up and z forward to z up, x forward
  add_pieces(body.triangles);
  orient();
  place_in_studio();
}

void SkinnedModel::add_pieces(const std::vector<std::array<uint32_t, 3>>& triangles) {
  for (ClosedSurface& surface : closed_surfaces(positions_, triangles)) {
    Piece& piece = pieces_.emplace_back();
    piece.surface = std::move(surface);
    piece.part.mesh.triangles = piece.surface.triangles;
    paint(piece);
  }
  V3D_CHECK(!pieces_.empty());
}

void SkinnedModel::orient() {
  const std::vector<Part> parts = parts_at(0);
  for (size_t p = 0; p < parts.size(); ++p) {
    if (enclosed_volume(parts[p].mesh) >= 0) continue;
    for (auto& triangle : pieces_[p].part.mesh.triangles) std::swap(triangle[1], triangle[2]);
  }
}

size_t SkinnedModel::main_joint(const ClosedSurface& surface) const {
  std::vector<float> share(joints_.size(), 0);
  for (const uint32_t v : surface.sources) {
    for (int k = 0; k < 4; ++k) {
      share[weights_[v].joints[static_cast<size_t>(k)]] += weights_[v].weights[k];
    }
  }
  return static_cast<size_t>(std::ranges::max_element(share) - share.begin());
}

/// Rotates the direction from a node to its farthest child to z.
Quaterniond SkinnedModel::along_bone(size_t node) const {
  Vector3d bone = Vector3d::Zero();
  for (const SkeletonNode& child : skeleton_.nodes()) {
    if (child.parent != static_cast<int>(node)) continue;
    const Vector3d to = child.matrix ? child.matrix->translation() : child.translation;
    if (to.norm() > bone.norm()) bone = to;
  }
  if (!(bone.norm() > 0)) bone = Vector3d::UnitY();
  return Quaterniond::FromTwoVectors(bone, Vector3d::UnitZ());
}

/// Chooses the material of a piece and its texture coordinates, metres.
void SkinnedModel::paint(Piece& piece) const {
  const SkinJoint& joint = joints_[main_joint(piece.surface)];
  piece.part.material = material_of(skeleton_.nodes()[joint.node].name);
  const double metres = scale_of(skeleton_.transforms(0)[joint.node]);
  const Quaterniond turn = along_bone(joint.node);
  for (const uint32_t v : piece.surface.sources) {
    const Vector3d in_joint = joint.node_from_mesh * positions_[v].cast<double>();
    piece.part.paint.push_back((metres * (turn * in_joint)).cast<float>());
  }
  piece.surface.add_middles(piece.part.paint);
}

void SkinnedModel::place_in_studio() {
  const int samples =
      std::clamp(static_cast<int>(std::min(1e6, kSamplesPerSecond * period_s())), 1, kMaxSamples);
  Vector3d root = Vector3d::Zero();
  bool is_finite = true;
  for (int i = 0; i < samples; ++i) {
    const double seconds = period_s() * i / samples;
    const std::vector<Vector3d> joints = joint_positions(seconds);
    root += joints[0] / samples;
    for (const Vector3d& joint : joints) is_finite = is_finite && joint.allFinite();
    for (const Part& part : parts_at(seconds)) {
      for (const Vector3f& vertex : part.mesh.vertices) {
        is_finite = is_finite && vertex.allFinite();
        extent_.extend(vertex.cast<double>());
      }
    }
    if (i == 0) height_m_ = extent_.sizes().z();
  }
  world_from_model_.translation() = -Vector3d(root.x(), root.y(), extent_.min().z());
  extent_.translate(world_from_model_.translation());
  if (!is_finite || !root.allFinite()) extent_.setEmpty();
}

std::vector<Part> SkinnedModel::parts_at(double seconds) const {
  const std::vector<Affine3d> model_from_node = skeleton_.transforms(seconds);
  std::vector<Eigen::Affine3f> world_from_mesh;
  for (const SkinJoint& joint : joints_) {
    world_from_mesh.push_back(
        (world_from_model_ * model_from_node[joint.node] * joint.node_from_mesh).cast<float>());
  }
  const auto place_of = [&](uint32_t v) {
    Vector3f place = Vector3f::Zero();
    for (int k = 0; k < 4; ++k) {
      const float weight = weights_[v].weights[k];
      if (weight == 0) continue;
      place +=
          weight * (world_from_mesh[weights_[v].joints[static_cast<size_t>(k)]] * positions_[v]);
    }
    return place;
  };
  std::vector<Part> parts;
  for (const Piece& piece : pieces_) {
    Part& part = parts.emplace_back(piece.part);
    for (const uint32_t v : piece.surface.sources) part.mesh.vertices.push_back(place_of(v));
    piece.surface.add_middles(part.mesh.vertices);
  }
  return parts;
}

std::vector<JointDefinition> SkinnedModel::joints() const {
  std::vector<JointDefinition> joints;
  for (const size_t node : joint_nodes_) {
    JointDefinition& joint = joints.emplace_back();
    joint.name = skeleton_.nodes()[node].name;
    // The nearest joint above it.
    for (int up = skeleton_.nodes()[node].parent; up >= 0 && joint.parent < 0;
         up = skeleton_.nodes()[static_cast<size_t>(up)].parent) {
      const auto found = std::ranges::find(joint_nodes_, static_cast<size_t>(up));
      if (found != joint_nodes_.end())
        joint.parent = static_cast<int>(found - joint_nodes_.begin());
    }
  }
  for (JointDefinition& joint : joints) {
    const std::string main = main_joint_of(joint.name);
    if (std::ranges::find(joints, main, &JointDefinition::main) == joints.end()) joint.main = main;
  }
  return joints;
}

std::vector<Vector3d> SkinnedModel::joint_positions(double seconds) const {
  const std::vector<Affine3d> model_from_node = skeleton_.transforms(seconds);
  std::vector<Vector3d> positions;
  for (const size_t node : joint_nodes_) {
    positions.emplace_back(world_from_model_ * model_from_node[node].translation());
  }
  return positions;
}

}  // namespace v3d::sim
