// Orders of the vertices of a surface: hierarchy by their triangles, binary tree by their position.
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

namespace v3d::codec {

/// Position of a vertex on the lattice of a motion file, steps.
using LatticePosition = std::array<int32_t, 3>;

/// A vertex of the hierarchy is surrounded by its coarse neighbours, which are coded before it.
///
/// Levels are made by removing independent vertices of few neighbours from the graph of edges,
/// finest level first. A removed vertex is merged into one of its neighbours, so that the rest of
/// the graph stays connected. docs/motion-format.md is normative.
/// Source: Dobkin and Kirkpatrick, "Fast detection of polyhedral intersection", 1983 (independent
/// sets).
class VertexHierarchy {
 public:
  static constexpr size_t kMaxNeighbours = 8;
  static constexpr int kMaxLevels = 32;
  /// Weights are in units of 1/4096; those of a vertex sum up to kOne.
  static constexpr int kWeightBits = 12;
  static constexpr int kOne = 1 << kWeightBits;

  /// Computes levels and coarse neighbours. All weights of a vertex are equal. Requires indices
  /// below `vertices`.
  VertexHierarchy(std::span<const std::array<uint32_t, 3>> triangles, uint32_t vertices);

  /// Sets the weights so that the weighted mean of the coarse neighbours is near the vertex, as
  /// far as their plane allows. An affine motion of a neighbourhood then moves the mean as it moves
  /// the vertex. Integer arithmetic: the same bits everywhere.
  void fit_weights(std::span<const LatticePosition> positions);

  /// All vertices, coarse ones first. Coarse neighbours precede a vertex.
  std::span<const uint32_t> order() const { return order_; }
  /// 0: finest. At most kMaxLevels, which is the coarsest: vertices that were never removed.
  int level(uint32_t vertex) const { return levels_[vertex]; }
  /// At least one for all vertices but order()[0], which has none.
  std::span<const uint32_t> neighbours(uint32_t vertex) const {
    return std::span(neighbours_).subspan(first_[vertex], first_[vertex + 1] - first_[vertex]);
  }
  std::span<const int16_t> weights(uint32_t vertex) const {
    return std::span(weights_).subspan(first_[vertex], first_[vertex + 1] - first_[vertex]);
  }

 private:
  std::vector<uint32_t> order_;
  std::vector<uint8_t> levels_;       ///< [vertex]
  std::vector<uint32_t> first_;       ///< [vertex]: position of its first coarse neighbour; and end
  std::vector<uint32_t> neighbours_;  ///< coarse neighbours of all vertices
  std::vector<int16_t> weights_;      ///< for each of neighbours_
};

// Binary tree over the vertices of a surface by their position, for transforms of their values.

/// Morton code of a position: the bits of x, y and z interleaved, those of x lowest. Uses the
/// lowest 21 bits of each.
uint64_t morton_code(uint32_t x, uint32_t y, uint32_t z);

/// The radix tree of the Morton codes of all vertices: each inner node divides its vertices by the
/// highest bit in which their codes differ. Vertices with equal codes are divided one by one, in
/// the order of their numbers. docs/compact-frame.md is normative.
class VertexTree {
 public:
  struct Node {
    uint32_t low, high;  ///< children: a vertex (below vertices()), or vertices() + an inner node
  };

  /// `codes`: the Morton code of each vertex.
  explicit VertexTree(std::span<const uint64_t> codes);

  uint32_t vertices() const { return vertices_; }
  /// All inner nodes, one less than the vertices. Children precede their parents; the root is last.
  std::span<const Node> nodes() const { return nodes_; }

 private:
  uint32_t vertices_;
  std::vector<Node> nodes_;
};

}  // namespace v3d::codec
