// Boxes in space, in a tree whose nodes are read by vector registers: which of them touch?
#pragma once

#include <Eigen/Geometry>
#include <array>
#include <cstdint>
#include <span>
#include <utility>
#include <vector>

namespace v3d {

/// Sixteen boxes in a leaf, sixteen leaves or nodes in a node. Which boxes share a leaf is decided
/// once, by where their middles are. They may be replaced by others: answers stay right, and take
/// the longer the farther the boxes have moved.
class BoxTree {
 public:
  using Box = Eigen::AlignedBox3f;
  static constexpr size_t kWidth = 16;
  using Places = uint16_t;  ///< in a leaf; the first is the lowest bit

  /// The numbers of two boxes that touch.
  using Pair = std::pair<uint32_t, uint32_t>;

  /// One array per side of the boxes. Where there is none it is empty and touches nothing.
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
  /// The numbers of a leaf's boxes, by place.
  std::span<const uint32_t> in_leaf(size_t leaf) const;
  /// Puts another box at a place. Boxes of different leaves may be replaced at the same time; then
  /// comes settle(), before the next question.
  void replace(size_t leaf, size_t place, const Box& box) { levels_[0][leaf].set(place, box); }
  void refit();

  /// Appends every pair that touches (common borders are enough) of one of the boxes at
  /// `chosen[leaf]` and any other. Who asks for all leaves gets each pair once. In no particular
  /// order; any thread. Vectorised for the processor it runs on.
  void overlapping(size_t leaf, std::span<const Places> chosen, std::vector<Pair>& pairs) const;

 private:
  std::vector<uint32_t> order_;            ///< numbers of the boxes, leaf by leaf
  std::vector<std::vector<Node>> levels_;  ///< leaves first; the last, not the first, has one node
};

}  // namespace v3d
