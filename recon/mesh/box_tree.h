// Bounding volume hierarchy of axis-aligned boxes with 16 children per node, for finding pairs of
// overlapping boxes with SIMD.
#pragma once

#include <Eigen/Geometry>
#include <array>
#include <cstdint>
#include <span>
#include <utility>
#include <vector>

#include "base/geometry/rigid_transform.h"

namespace v3d::recon {

/// Leaves hold 16 boxes, nodes 16 leaves or nodes. Boxes are assigned to leaves once, by the Morton
/// code of their centres. Boxes may be replaced later: results stay correct, but queries become
/// slower the farther the boxes move.
class BoxTree {
 public:
  using Box = Eigen::AlignedBox3f;
  static constexpr size_t kWidth = 16;
  using Places = uint16_t;  ///< a bit per box of a leaf; the first is the lowest

  /// The numbers of two overlapping boxes.
  using Pair = std::pair<uint32_t, uint32_t>;

  /// One array per side of the boxes. An unused place holds an empty box, which overlaps nothing.
  struct Node {
    alignas(64) std::array<std::array<float, kWidth>, 3> low, high;
    Node();
    void set(size_t place, const Box& box) {
      for (int a = 0; a < 3; ++a) {
        low[a][place] = box.min()[a];
        high[a][place] = box.max()[a];
      }
    }
    Box at(size_t place) const {
      return {Eigen::Vector3f(low[0][place], low[1][place], low[2][place]),
              Eigen::Vector3f(high[0][place], high[1][place], high[2][place])};
    }
  };

  BoxTree() = default;
  explicit BoxTree(std::span<const Box> boxes);

  size_t leaves() const { return (order_.size() + kWidth - 1) / kWidth; }
  /// The numbers of the boxes of a leaf, by place.
  std::span<const uint32_t> in_leaf(size_t leaf) const;
  /// Replaces a box. Boxes of different leaves may be replaced at the same time. Call refit()
  /// before the next query.
  void replace(size_t leaf, size_t place, const Box& box) { levels_[0][leaf].set(place, box); }
  void refit();

  /// Appends every pair of overlapping boxes (shared borders count) of which one is at
  /// `chosen[leaf]`. Queries of all leaves give each pair once, in no particular order. Any thread.
  /// Vectorised by run-time dispatch; every instruction set gives the same bits.
  void overlapping(size_t leaf, std::span<const Places> chosen, std::vector<Pair>& pairs) const;

 private:
  std::vector<uint32_t> order_;            ///< numbers of boxes, leaf by leaf
  std::vector<std::vector<Node>> levels_;  ///< leaves first; the last, not the first, has one node
};

}  // namespace v3d::recon
