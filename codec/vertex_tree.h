// Binary tree over the vertices of a surface by their position, for transforms of their values.
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

namespace v3d::codec {

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
