// Weighted graphs over the vertices of any mesh, and shortest paths in them.
#pragma once

#include <cstddef>
#include <cstdint>
#include <limits>
#include <span>
#include <utility>
#include <vector>

#include "base/geometry/mesh.h"

namespace v3d::recon {

/// Undirected graph in compressed rows; each edge is stored in both directions. Immutable; any
/// thread.
class VertexGraph {
 public:
  struct Link {
    uint32_t to = 0;
    float metres = 0;
  };
  struct Edge {
    uint32_t a = 0, b = 0;
    float metres = 0;
  };

  VertexGraph() = default;
  /// Requires each edge once, in one direction.
  VertexGraph(size_t vertices, const std::vector<Edge>& edges);
  /// The edges of a mesh, each once. The mesh can have holes and edges of more than two triangles.
  explicit VertexGraph(const Mesh& mesh);

  size_t size() const { return first_.empty() ? 0 : first_.size() - 1; }
  std::span<const Link> of(size_t vertex) const {
    return {links_.data() + first_[vertex], first_[vertex + 1] - first_[vertex]};
  }

 private:
  std::vector<uint32_t> first_;
  std::vector<Link> links_;
};

/// Dijkstra's algorithm. Keeps its queue. One caller at a time.
class ShortestPaths {
 public:
  static constexpr float kUnreached = std::numeric_limits<float>::infinity();

  /// Lowers `distances` (one for each vertex, metres) from all vertices of `sources`, whose own
  /// distances are set. Visits vertices up to `limit_m`, and calls visit(vertex, previous) when a
  /// distance falls.
  template <class Visit>
  void run(const VertexGraph& graph, std::span<const uint32_t> sources, float limit_m,
           std::vector<float>& distances, const Visit& visit);

 private:
  using Entry = std::pair<float, uint32_t>;
  void push(Entry entry);
  Entry pop();
  std::vector<Entry> queue_;
};

template <class Visit>
void ShortestPaths::run(const VertexGraph& graph, std::span<const uint32_t> sources, float limit_m,
                        std::vector<float>& distances, const Visit& visit) {
  queue_.clear();
  for (const uint32_t source : sources) push({distances[source], source});
  while (!queue_.empty()) {
    const auto [metres, vertex] = pop();
    if (metres > distances[vertex]) continue;
    for (const VertexGraph::Link& link : graph.of(vertex)) {
      const float further = metres + link.metres;
      if (further >= distances[link.to] || further > limit_m) continue;
      distances[link.to] = further;
      visit(link.to, vertex);
      push({further, link.to});
    }
  }
}

}  // namespace v3d::recon
