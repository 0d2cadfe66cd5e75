// Augmented multiresolution Reeb graph of a mesh: its branches, and the similarity of two graphs.
#pragma once

#include <Eigen/Core>
#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "base/geometry/mesh.h"
#include "recon/skeleton/geodesic_integral.h"

namespace v3d::recon {

/// A connected piece of the surface whose geodesic integral lies in one interval.
struct ReebNode {
  static constexpr uint32_t kNoParent = 0xFFFFFFFF;
  uint32_t interval = 0;         ///< number, from 0 in the middle of the body
  uint32_t component = 0;        ///< connected part of the mesh
  uint32_t parent = kNoParent;   ///< node of the next coarser level that contains this one
  double area = 0, volume = 0;   ///< fractions of the mesh; of the nodes of a level, the sum is 1
  double low_m = 0, high_m = 0;  ///< mean geodesic distance: range over the piece, metres
  Eigen::Vector3d centre = Eigen::Vector3d::Zero();  ///< of its area, metres
  /// Standard deviations of its area along its principal axes, greatest first, metres.
  Eigen::Vector3d extent = Eigen::Vector3d::Zero();
  double perimeter = 0;  ///< area divided by the range of the integral, metres
};

/// The nodes of one resolution: 2^level intervals.
struct ReebLevel {
  std::vector<ReebNode> nodes;
  std::vector<std::array<uint32_t, 2>> edges;  ///< nodes that touch; a < b, ascending
};

struct ReebGraph {
  std::vector<ReebLevel> levels;      ///< coarse to fine: 1, 2, 4 ... intervals
  std::vector<uint32_t> node_of;      ///< finest node of each vertex; kNoParent without triangles
  double area_m2 = 0, volume_m3 = 0;  ///< of the mesh
  Eigen::Vector3d centre = Eigen::Vector3d::Zero();  ///< of its area, metres
  bool empty() const { return levels.empty() || levels.back().nodes.empty(); }
};

struct ReebOptions {
  size_t levels = 7;  ///< 1 to 16: the finest has 2^(levels - 1) intervals
  GeodesicOptions geodesic;
};

/// Reeb graph of the geodesic integral of `mesh`. Triangles are not cut at the ends of intervals: a
/// vertex belongs to one node, and an edge that crosses several intervals joins two nodes. The
/// volume of a node is that between its surface and its centre. A mesh without area has no nodes.
///
/// Requires finite positions and valid indices. Deterministic; thread-safe. Sources: Hilaga et al.,
/// Topology matching, SIGGRAPH 2001, section 4; Tung and Schmitt, The augmented multiresolution
/// Reeb graph approach, IJSM 2005 (attributes).
ReebGraph reeb_graph(const Mesh& mesh, const ReebOptions& options = {});

// Branches of a Reeb graph: limbs, head and props of a body.

/// Part of the finest level from an end, where the geodesic integral has a local maximum, to where
/// it meets a branch whose end is farther out.
struct GraphBranch {
  /// From the end inwards: one node for each interval; where the branch divides, the largest.
  std::vector<uint32_t> nodes;
  double length_m = 0;                            ///< range of the integral along the branch
  double area = 0;                                ///< of all its nodes, fraction of the mesh
  Eigen::Vector3d end = Eigen::Vector3d::Zero();  ///< centre of the outermost node, metres
  /// Number of nodes, from the end, before the branch first divides or its perimeter exceeds 1.6
  /// times the median of what was before.
  size_t slender = 0;
  double slender_length_m = 0;  ///< along the centres of these nodes
  double slender_radius_m = 0;  ///< median of perimeter / 2 pi of these nodes
};

/// Branches of at least `min_length_m`, the longest first. The longest of each component ends in
/// the middle of the body. Nodes below 0.02 % of the area are ignored. Source: the elder rule of
/// persistence (Edelsbrunner et al., 2002), applied to the integral.
std::vector<GraphBranch> graph_branches(const ReebGraph& graph, double min_length_m);

// Similarity of two augmented multiresolution Reeb graphs, and retrieval by it.

/// Similarity of two graphs, from 0 to 1; symmetric; 1 for equal graphs. Graphs without nodes: 0.
///
/// Nodes are matched from coarse to fine: of the same interval, with matched parents, the most
/// alike first. A matched pair adds the smaller of its two shares of area and volume, times how
/// alike its extent, perimeter and position are. The position is the height over the lowest node
/// and the distance from the vertical axis of the body, so that a turn about this axis changes
/// nothing. All levels count equally. Requires the same number of levels. Thread-safe.
///
/// Sources: Hilaga et al., SIGGRAPH 2001, section 5; Tung and Schmitt, IJSM 2005 (attributes).
/// Deviations: docs/skeleton.md.
double graph_similarity(const ReebGraph& a, const ReebGraph& b);

struct SimilarPulse {
  int64_t pulse = 0;
  double similarity = 0;
};

/// The `count` pulses whose graphs are most similar to `query`, best first. `pulses`: that of each
/// graph. Of pulses less than `apart` from one another only the best one is returned.
std::vector<SimilarPulse> most_similar(const ReebGraph& query, std::span<const ReebGraph> graphs,
                                       std::span<const int64_t> pulses, size_t count,
                                       int64_t apart);

}  // namespace v3d::recon
