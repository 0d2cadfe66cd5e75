// A performer from a skinned, animated mesh: each vertex moves with up to four joints of a
// skeleton.
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "sim/performer/performer.h"
#include "sim/performer/skeleton.h"

namespace v3d::sim {

// Closed surfaces from the triangles of a model: welded seams, connected surfaces, closed holes.

/// A connected surface. Its vertices are those of `sources`, then one for each hole: the mean of
/// the vertices around the hole.
struct ClosedSurface {
  std::vector<uint32_t> sources;                   ///< indices of the given vertices
  std::vector<std::vector<uint32_t>> holes;        ///< by hole its vertices, indices of `sources`
  std::vector<std::array<uint32_t, 3>> triangles;  ///< indices of the vertices of this surface

  /// Appends the mean of the values around each hole to the values of `sources`.
  void add_middles(std::vector<Eigen::Vector3f>& values) const;
};

/// The connected surfaces of triangles. Vertices at equal positions count as one: the first of
/// them. Triangles that have a vertex twice are left out. For every directed edge of a surface
/// there is an opposite one, because triangles to its middle close a hole.
std::vector<ClosedSurface> closed_surfaces(std::span<const Eigen::Vector3f> positions,
                                           std::span<const std::array<uint32_t, 3>> triangles);

/// A joint of a skin: a node, and the transform from the mesh to the node at rest.
struct SkinJoint {
  size_t node = 0;
  Eigen::Affine3d node_from_mesh = Eigen::Affine3d::Identity();
};

/// The joints that move a vertex, and their weights.
struct SkinWeights {
  std::array<uint32_t, 4> joints{};                       ///< indices of SkinnedBody::joints
  Eigen::Vector4f weights = Eigen::Vector4f(1, 0, 0, 0);  ///< sum 1
};

/// A skinned body as a file describes it. Axes of glTF: y up, the body looks along z.
struct SkinnedBody {
  std::vector<SkeletonNode> nodes;
  std::vector<SkinJoint> joints;
  std::vector<Eigen::Vector3f> positions;  ///< of vertices at rest
  std::vector<SkinWeights> weights;        ///< by vertex
  std::vector<std::array<uint32_t, 3>> triangles;
};

/// The body as parts of a performer, at any time of its animation, which repeats.
///
/// - Each connected surface becomes a part (closed_surfaces()). A surface that encloses a negative
///   volume is turned inside out.
/// - A part has the material of the joint that moves most of it, by the name of its node: skin at
///   head and hands, trousers at hips and legs, socks at the feet, the jacket elsewhere. Its
///   texture coordinates are positions at rest relative to this joint, with z along the bone.
/// - The performer looks along x of the world at the first time, if the body looks along z of the
///   file. The mean position of the root joint is above the origin. The lowest vertex of the whole
///   animation is on the floor.
///
/// The animation: AnimatedSkeleton. Immutable; any thread.
/// Source of the skinning: glTF 2.0, chapter 3.7.3 (linear blend skinning).
class SkinnedModel {
 public:
  /// Requires valid indices, finite positions, and a triangle whose vertices differ.
  explicit SkinnedModel(SkinnedBody body);

  double period_s() const { return skeleton_.period_s(); }
  /// The vertical extent at the first time, metres.
  double height_m() const { return height_m_; }
  /// All vertices in the whole animation: world frame, metres. Empty if a vertex or joint is not
  /// finite.
  const Eigen::AlignedBox3d& extent() const { return extent_; }

  /// World frame, metres. `seconds`: any time since the first key.
  std::vector<Part> parts_at(double seconds) const;

  /// The nodes of the joints, each once.
  std::vector<JointDefinition> joints() const;
  /// World frame, metres; in the order of joints().
  std::vector<Eigen::Vector3d> joint_positions(double seconds) const;

 private:
  struct Piece {
    ClosedSurface surface;
    Part part;  ///< without vertices
  };

  void add_pieces(const std::vector<std::array<uint32_t, 3>>& triangles);
  void orient();
  void paint(Piece& piece) const;
  size_t main_joint(const ClosedSurface& surface) const;
  Eigen::Quaterniond along_bone(size_t node) const;
  void place_in_studio();

  std::vector<SkinJoint> joints_;
  std::vector<size_t> joint_nodes_;
  std::vector<Eigen::Vector3f> positions_;
  std::vector<SkinWeights> weights_;
  AnimatedSkeleton skeleton_;
  std::vector<Piece> pieces_;
  Eigen::Affine3d world_from_model_ = Eigen::Affine3d::Identity();
  Eigen::AlignedBox3d extent_;
  double height_m_ = 0;
};

}  // namespace v3d::sim
