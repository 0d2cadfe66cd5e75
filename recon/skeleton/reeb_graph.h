// Augmented multiresolution Reeb graph of a mesh.
#pragma once

#include <Eigen/Core>
#include <array>
#include <cstddef>
#include <cstdint>
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

}  // namespace v3d::recon
