// Geodesic integral function of a mesh: how far each vertex is from the rest of the surface.
#pragma once

#include <cstddef>
#include <cstdint>
#include <limits>
#include <span>
#include <utility>
#include <vector>

#include "base/geometry/mesh.h"

namespace v3d::recon {

// Weighted graphs over the vertices of any mesh, and shortest paths in them.

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

// The geodesic integral.

struct GeodesicOptions {
  size_t samples = 900;  ///< of the graph in which paths run, about
  size_t bases = 40;     ///< samples from which distances are integrated, about
};

/// One value for each vertex; vertices without a triangle have `component` kNoComponent.
struct GeodesicIntegral {
  static constexpr uint32_t kNoComponent = 0xFFFFFFFF;
  std::vector<float> metres;  ///< mean geodesic distance to the surface of the component
  /// (mean - least) / greatest of the component: 0 to below 1, 0 in the middle of the body.
  std::vector<float> normalised;
  std::vector<uint32_t> component;  ///< connected part of the surface, from 0
  size_t components = 0;
};

/// Area of each vertex: a third of its triangles, square metres.
std::vector<double> vertex_areas(const Mesh& mesh);

/// Integrates geodesic distances over each connected component of a mesh: with holes, handles and
/// edges of more than two triangles. `graph`: of the mesh. Requires finite positions.
///
/// Samples cover the surface by geodesic balls. Paths run between samples whose regions touch, and
/// those two steps apart (short cut edges). Bases cover the samples in the same way; the area of
/// its region is the weight of a base. Values of vertices are interpolated between samples.
/// Deterministic; independent of thread count, and of rigid motion and the order of vertices except
/// for ties. Thread-safe; works in the caller's TBB arena. Source: Hilaga et al., Topology
/// matching, SIGGRAPH 2001, equations (1) to (4).
GeodesicIntegral geodesic_integral(const Mesh& mesh, const VertexGraph& graph,
                                   const GeodesicOptions& options = {});

}  // namespace v3d::recon
