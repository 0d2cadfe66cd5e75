// Neighbourhoods of a mesh: edges, neighbours, loops around vertices, smoothing.
#pragma once

#include <tbb/parallel_for.h>

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "base/geometry/mesh.h"

namespace v3d::recon {

// Adjacency of the vertices of a mesh, as lists and in a layout for SIMD.

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

// Parallel loops over the vertices of a mesh.

/// Calls work(begin, end) for consecutive blocks of kBlock indices below `count`, in parallel. A
/// call may write only data of its own block.
template <size_t kBlock, class Work>
void for_each_block(size_t count, const Work& work) {
  tbb::parallel_for(size_t{0}, (count + kBlock - 1) / kBlock, [&](size_t block) {
    work(block * kBlock, std::min(count, (block + 1) * kBlock));
  });
}

/// Calls work(v) for each v below `count`, in parallel. A call may write only data of v.
template <class Work>
void for_each_vertex(size_t count, const Work& work) {
  for_each_block<512>(count, [&](size_t begin, size_t end) {
    for (size_t v = begin; v < end; ++v) work(v);
  });
}

// Smoothing of a mesh, and the internal force of the deformation.

/// Taubin smoothing: `passes` steps towards the mean of the neighbours. After each, a slightly
/// smaller step back prevents shrinking. `work` keeps its memory. Works in the caller's TBB arena;
/// independent of thread count. Source: Taubin, A signal processing approach to fair surface
/// design, SIGGRAPH 1995.
void smooth_surface(const Neighbours& neighbours, int passes,
                    std::vector<Eigen::Vector3f>& vertices, std::vector<Eigen::Vector3f>& work);

/// Replaces each unit normal by the normalised sum of itself and its neighbours, `passes` times.
void smooth_normals(const Neighbours& neighbours, int passes, std::vector<Eigen::Vector3f>& normals,
                    std::vector<Eigen::Vector3f>& work);

/// Vector from a vertex to the mean of its neighbours. Source: equation (2) of the paper.
Eigen::Vector3f internal_force(const Neighbours& neighbours,
                               const std::vector<Eigen::Vector3f>& vertices, size_t vertex);

// Edge lengths of a mesh: measure and subdivide.

/// Mean length of the first edges of all triangles, metres; close to the voxel size for a surface
/// of marching cubes. 0 without triangles.
double mean_edge(const Mesh& mesh);

/// Approximate number of triangles that with_short_edges() adds, within a factor of about four.
double added_triangles(const Mesh& mesh, double max_m);

/// The same surface with no edge longer than `max_m` metres. Longer edges are halved, in both
/// triangles alike, so that no cracks appear. An edge far from the origin stays where single
/// precision rounds its middle to one of its ends, or near it. The vertices of `mesh` come first
/// and do not move; colours are left out. Memory is not limited: see added_triangles(). Requires
/// max_m > 0.
Mesh with_short_edges(const Mesh& mesh, double max_m);

}  // namespace v3d::recon
