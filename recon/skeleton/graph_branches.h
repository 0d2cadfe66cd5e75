// Branches of a Reeb graph: limbs, head and props of a body.
#pragma once

#include <cstdint>
#include <vector>

#include "recon/skeleton/reeb_graph.h"

namespace v3d::recon {

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

}  // namespace v3d::recon
