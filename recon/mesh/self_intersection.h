// Where a surface goes through itself.
#pragma once

#include <cstdint>
#include <utility>
#include <vector>

#include "base/mesh.h"
#include "recon/mesh/box_tree.h"

namespace v3d {

/// Two triangles, the one with the lower number first.
using Crossing = std::pair<uint32_t, uint32_t>;

/// Every pair of triangles that cross although they share no vertex: an edge of one goes through
/// the inside of the other. Triangles that only touch, or lie in one plane, do not count. Exact up
/// to the rounding of double precision. Rising; the same for any number of threads.
std::vector<Crossing> self_intersections(const Mesh& mesh);

/// The same for a mesh whose vertices move: what does not is not looked at again. Borrows the mesh.
/// Works in the caller's TBB arena.
class CrossingFinder {
 public:
  explicit CrossingFinder(const Mesh& mesh);

  std::vector<Crossing> all() const;
  /// `moved`: one per vertex, those that moved since the question before. Only the pairs that a
  /// triangle with such a corner takes part in.
  std::vector<Crossing> of_moved(const std::vector<uint8_t>& moved);

 private:
  using Chosen = std::vector<BoxTree::Places>;  ///< one per leaf
  std::vector<Crossing> find(const Chosen& chosen) const;

  const Mesh& mesh_;
  BoxTree tree_;  ///< of the triangles' boxes
};

}  // namespace v3d
