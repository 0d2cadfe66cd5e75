// Adjacency of the vertices of a mesh, as lists and in a layout for SIMD.
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "base/geometry/mesh.h"

namespace v3d {

/// The neighbours of every vertex of a closed mesh, each once. Immutable; any thread.
class Neighbours {
 public:
  Neighbours() = default;
  explicit Neighbours(const Mesh& mesh);
  size_t size() const { return first_.empty() ? 0 : first_.size() - 1; }  ///< vertices
  std::span<const uint32_t> of(size_t vertex) const {
    return {list_.data() + first_[vertex], first_[vertex + 1] - first_[vertex]};
  }

 private:
  std::vector<uint32_t> first_, list_;
};

/// Adjacency in groups of sixteen vertices; row k of a group holds the k-th neighbour of each of
/// them, in the order of Neighbours. Immutable; any thread.
class NeighbourRows {
 public:
  static constexpr size_t kWidth = 16;
  /// Indices of vertices; vertices() where a vertex has fewer neighbours than others of its group.
  struct alignas(64) Row {
    std::array<int32_t, kWidth> vertex;
  };
  /// One number per vertex of a group.
  struct alignas(64) Values {
    std::array<float, kWidth> of{};
  };

  NeighbourRows() = default;
  explicit NeighbourRows(const Neighbours& neighbours);

  size_t groups() const { return counts_.size(); }
  /// Vertices including the padding of the last group, which has no neighbours.
  size_t vertices() const { return groups() * kWidth; }
  std::span<const Row> rows(size_t group) const {
    return std::span(rows_).subspan(first_[group], first_[group + 1] - first_[group]);
  }
  /// Number of neighbours of each vertex of a group.
  const Values& counts(size_t group) const { return counts_[group]; }

 private:
  std::vector<uint32_t> first_;  ///< of each group, in rows_; and the end
  std::vector<Row> rows_;
  std::vector<Values> counts_;
};

}  // namespace v3d
