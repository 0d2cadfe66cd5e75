// Deformation graph: moves a surface by the rigid motions of nodes that are spread over it.
#pragma once

#include <Eigen/Core>
#include <array>
#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "base/geometry/mesh.h"
#include "recon/mesh/mesh_neighbours.h"

namespace v3d::recon {

/// The rigid motion of a node: its neighbourhood turns by `rotation` around it, and the node is at
/// `position` (world, metres).
struct NodeMotion {
  Eigen::Matrix3d rotation = Eigen::Matrix3d::Identity();
  Eigen::Vector3d position = Eigen::Vector3d::Zero();
};

/// Nodes of a template surface at rest, and the influence of each on the vertices near it.
/// Immutable after construction but for the stiffness of its edges; any thread may read.
///
/// Source: Sumner, Schmid and Pauly, Embedded deformation for shape manipulation, SIGGRAPH 2007.
class DeformationGraph {
 public:
  static constexpr int kInfluences = 4;  ///< nodes that move a vertex

  /// Nodes near a vertex; their weights sum to 1. Unused entries repeat the first node, with
  /// weight 0.
  struct Influence {
    std::array<uint32_t, kInfluences> node{};
    std::array<float, kInfluences> weight{};
  };
  /// Two nodes that move the same part of the surface, or neighbouring parts that do not touch.
  struct Edge {
    uint32_t a = 0, b = 0;
    /// 1: usual. More where the surface was seen to move rigidly, less where it bends.
    float stiffness = 1;
  };

  /// Spreads nodes over the connected parts of `rest`, about `spacing_m` apart along the edges of
  /// the mesh. Every part has at least one node. Requires spacing_m > 0.
  DeformationGraph(const Mesh& rest, double spacing_m);

  size_t nodes() const { return rest_.size(); }
  const std::vector<Eigen::Vector3d>& rest() const { return rest_; }
  const std::vector<Influence>& influences() const { return influences_; }
  const std::vector<Edge>& edges() const { return edges_; }
  std::vector<Edge>& edges() { return edges_; }
  /// The vertex of the template at which each node lies.
  const std::vector<uint32_t>& vertices_of_nodes() const { return vertex_of_node_; }
  double spacing_m() const { return spacing_m_; }

  /// The nodes at rest.
  std::vector<NodeMotion> rest_motion() const;

  /// Position of vertex `v`, which is at `rest` in the template.
  Eigen::Vector3d moved(std::span<const NodeMotion> motion, size_t v,
                        const Eigen::Vector3d& rest) const;
  /// Rotation of the surface around vertex `v`: that of the nodes, blended and made orthonormal.
  Eigen::Matrix3d rotation_at(std::span<const NodeMotion> motion, size_t v) const;

  /// All vertices of a template; in parallel, in the caller's TBB arena.
  void move(std::span<const NodeMotion> motion, const std::vector<Eigen::Vector3f>& rest,
            std::vector<Eigen::Vector3f>& moved) const;

 private:
  void spread_nodes(const Mesh& rest, const Neighbours& neighbours);
  void find_influences(const Mesh& rest, const Neighbours& neighbours);
  void find_edges();
  /// Joins parts of the surface that nearly touch, such as the pieces of a broken blade.
  void link_components(const Mesh& rest, const Neighbours& neighbours);

  double spacing_m_;
  std::vector<Eigen::Vector3d> rest_;
  std::vector<uint32_t> vertex_of_node_;
  std::vector<Influence> influences_;  ///< one per vertex
  std::vector<Edge> edges_;            ///< a < b, ascending
};

/// Sets the stiffness of each edge by how rigidly its two nodes moved together over `motions`: 1
/// for a root mean square deviation of 2 mm from a rigid motion, more for a smaller one, from 0.1
/// to 10. Each motion has one entry per node. Requires at least one motion.
void learn_stiffness(DeformationGraph& graph, std::span<const std::vector<NodeMotion>> motions);

/// One measurement of a vertex: its position along `direction` (unit length) should be that of
/// `target`. A point of a surface has one, a matched point three.
struct VertexTarget {
  uint32_t vertex = 0;
  float weight = 0;
  Eigen::Vector3f direction = Eigen::Vector3f::Zero();
  Eigen::Vector3f target = Eigen::Vector3f::Zero();  ///< world, metres
};

struct GraphSolverOptions {
  /// Weight of an edge of stiffness 1, which penalises non-rigid relative motion of its two nodes,
  /// against a VertexTarget of weight 1.
  double rigidity = 10;
  /// Weight of equal rotations of the nodes of an edge, at a lever of the node spacing.
  double bending = 1;
  int iterations = 3;  ///< of Gauss and Newton
};

/// Fits the motion of the nodes to targets of the vertices by Gauss-Newton steps, each solved by
/// conjugate gradients. Keeps its working memory. One caller at a time; works in the caller's TBB
/// arena. Deterministic: independent of thread count.
class GraphSolver {
 public:
  /// `graph` and `rest`, the vertices of its template, are borrowed.
  GraphSolver(const DeformationGraph& graph, const std::vector<Eigen::Vector3f>& rest);
  ~GraphSolver();

  /// Improves `motion`, one entry per node.
  void solve(std::span<const VertexTarget> targets, const GraphSolverOptions& options,
             std::vector<NodeMotion>& motion);

 private:
  class Impl;
  std::unique_ptr<Impl> impl_;
};

/// The motion when each node turns and moves on as it did from `before` to `now`. `ratio`: the time
/// from `now` to the result, as a multiple of the time from `before` to `now`; 1 for pulses that
/// are evenly spaced. Requires motions of the same nodes and ratio > 0.
std::vector<NodeMotion> with_same_speed(std::span<const NodeMotion> before,
                                        std::span<const NodeMotion> now, double ratio);

}  // namespace v3d::recon
