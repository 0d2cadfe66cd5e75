// Detection of self-intersections of a triangle mesh.
#pragma once

#include <cstdint>
#include <utility>
#include <vector>

#include "base/geometry/mesh.h"
#include "recon/mesh/box_tree.h"

namespace v3d {

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

}  // namespace v3d
