#include "recon/mesh/neighbours.h"

#include <tbb/parallel_for.h>

#include <algorithm>

namespace v3d {

// In a closed mesh, each edge belongs to two triangles with opposite directions. So the corners
// that follow a vertex in its triangles are its neighbours, each once.
Neighbours::Neighbours(const Mesh& mesh) : first_(mesh.vertices.size() + 1, 0) {
  for (const auto& t : mesh.triangles) {
    for (const uint32_t v : t) ++first_[v + 1];
  }
  for (size_t v = 1; v < first_.size(); ++v) first_[v] += first_[v - 1];
  list_.resize(first_.back());
  std::vector<uint32_t> next(first_.begin(), first_.end() - 1);
  for (const auto& [a, b, c] : mesh.triangles) {
    list_[next[a]++] = b;
    list_[next[b]++] = c;
    list_[next[c]++] = a;
  }
}

NeighbourRows::NeighbourRows(const Neighbours& neighbours) {
  const size_t count = neighbours.size(), groups = (count + kWidth - 1) / kWidth;
  first_.assign(groups + 1, 0);
  counts_.resize(groups);
  const auto for_each_group = [&](const auto& work) {
    tbb::parallel_for(size_t{0}, groups, [&](size_t group) {
      const size_t begin = group * kWidth, end = std::min(count, begin + kWidth);
      for (size_t v = begin; v < end; ++v) work(group, v - begin, neighbours.of(v));
    });
  };
  for_each_group([&](size_t group, size_t lane, std::span<const uint32_t> around) {
    counts_[group].of[lane] = static_cast<float>(around.size());
    first_[group + 1] = std::max(first_[group + 1], static_cast<uint32_t>(around.size()));
  });
  for (size_t group = 0; group < groups; ++group) first_[group + 1] += first_[group];
  Row no_neighbours;
  no_neighbours.vertex.fill(static_cast<int32_t>(vertices()));
  rows_.assign(first_.back(), no_neighbours);
  for_each_group([&](size_t group, size_t lane, std::span<const uint32_t> around) {
    for (size_t k = 0; k < around.size(); ++k) {
      rows_[first_[group] + k].vertex[lane] = static_cast<int32_t>(around[k]);
    }
  });
}

}  // namespace v3d
