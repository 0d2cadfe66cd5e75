// Self-intersections of a mesh: detection and removal.
#pragma once

#include <cstdint>
#include <optional>
#include <utility>
#include <vector>

#include "base/geometry/mesh.h"
#include "recon/mesh/box_tree.h"
#include "recon/mesh/mesh_neighbours.h"

namespace v3d::recon {

// Detection of self-intersections of a triangle mesh.

/// The numbers of two triangles, ascending.
using Crossing = std::pair<uint32_t, uint32_t>;

/// All pairs of triangles without a common vertex of which an edge of one passes through the
/// interior of the other. Touching and coplanar triangles do not count. Exact up to rounding in
/// double precision. Sorted; independent of thread count.
std::vector<Crossing> self_intersections(const Mesh& mesh);

/// Repeated detection for a mesh whose vertices move; tests only triangles that moved. Borrows the
/// mesh. Works in the caller's TBB arena.
class CrossingFinder {
 public:
  explicit CrossingFinder(const Mesh& mesh);

  std::vector<Crossing> all() const;
  /// The crossings of triangles with a moved vertex. `moved` has one entry per vertex: 1 where it
  /// moved since the previous query.
  std::vector<Crossing> of_moved(const std::vector<uint8_t>& moved);

 private:
  using Chosen = std::vector<BoxTree::Places>;  ///< one per leaf
  std::vector<Crossing> find(const Chosen& chosen) const;

  const Mesh& mesh_;
  BoxTree tree_;  ///< bounding boxes of the triangles
};

// Removes self-intersections that a deformation added to a mesh.

/// Smooths the surface around every self-intersection, which removes folds and spikes. Vertices of
/// the remaining self-intersections move back towards `start`: by half in each pass, in growing
/// regions. In the last step they move back completely, in regions that grow until nothing
/// intersects.
///
/// All vertices end on `lattice`, if there is one; `start` must lie on it. Returns the number of
/// remaining self-intersections: 0 unless `start` intersects itself. Works in the caller's TBB
/// arena; independent of thread count.
size_t remove_self_intersections(const Neighbours& neighbours,
                                 const std::vector<Eigen::Vector3f>& start,
                                 const std::optional<VertexLattice>& lattice, Mesh& mesh);

}  // namespace v3d::recon
