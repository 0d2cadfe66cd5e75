// Which vertices of a mesh an edge joins.
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "base/mesh.h"

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

/// Sixteen vertices stand side by side in a group; its k-th row holds the k-th neighbour of each,
/// in the order of Neighbours. Immutable; any thread.
class NeighbourRows {
 public:
  static constexpr size_t kWidth = 16;
  /// Numbers of vertices; vertices() where one has fewer neighbours than others of its group.
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
  /// Those that exist and those that fill the last group, which have no neighbours.
  size_t vertices() const { return groups() * kWidth; }
  std::span<const Row> rows(size_t group) const {
    return std::span(rows_).subspan(first_[group], first_[group + 1] - first_[group]);
  }
  /// How many neighbours each vertex of a group has.
  const Values& counts(size_t group) const { return counts_[group]; }

 private:
  std::vector<uint32_t> first_;  ///< of each group, in rows_; and the end
  std::vector<Row> rows_;
  std::vector<Values> counts_;
};

}  // namespace v3d
