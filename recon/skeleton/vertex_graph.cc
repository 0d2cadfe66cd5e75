#include "recon/skeleton/vertex_graph.h"

#include <algorithm>
#include <functional>

namespace v3d::recon {

VertexGraph::VertexGraph(size_t vertices, const std::vector<Edge>& edges)
    : first_(vertices + 1, 0) {
  for (const Edge& edge : edges) {
    ++first_[edge.a + 1];
    ++first_[edge.b + 1];
  }
  for (size_t v = 1; v < first_.size(); ++v) first_[v] += first_[v - 1];
  links_.resize(first_.back());
  std::vector<uint32_t> next(first_.begin(), first_.end() - 1);
  for (const Edge& edge : edges) {
    links_[next[edge.a]++] = {edge.b, edge.metres};
    links_[next[edge.b]++] = {edge.a, edge.metres};
  }
}

VertexGraph::VertexGraph(const Mesh& mesh) {
  std::vector<uint32_t> begin(mesh.vertices.size() + 1, 0);
  for (const auto& triangle : mesh.triangles) {
    for (const uint32_t v : triangle) begin[v + 1] += 2;
  }
  for (size_t v = 1; v < begin.size(); ++v) begin[v] += begin[v - 1];
  std::vector<uint32_t> others(begin.back()), end(begin.begin(), begin.end() - 1);
  for (const auto& triangle : mesh.triangles) {
    for (size_t corner = 0; corner < 3; ++corner) {
      const uint32_t v = triangle[corner];
      for (const size_t step : {size_t{1}, size_t{2}}) {
        const uint32_t other = triangle[(corner + step) % 3];
        auto* const first = others.data() + begin[v];
        auto* const last = others.data() + end[v];
        if (other == v || std::find(first, last, other) != last) continue;
        *last = other;
        ++end[v];
      }
    }
  }
  first_.assign(begin.size(), 0);
  links_.reserve(others.size() / 2);
  for (size_t v = 0; v < mesh.vertices.size(); ++v) {
    for (uint32_t i = begin[v]; i < end[v]; ++i) {
      const float metres = (mesh.vertices[others[i]] - mesh.vertices[v]).norm();
      links_.push_back({others[i], metres});
    }
    first_[v + 1] = static_cast<uint32_t>(links_.size());
  }
}

void ShortestPaths::push(Entry entry) {
  queue_.push_back(entry);
  std::ranges::push_heap(queue_, std::greater<>());
}

ShortestPaths::Entry ShortestPaths::pop() {
  std::ranges::pop_heap(queue_, std::greater<>());
  const Entry entry = queue_.back();
  queue_.pop_back();
  return entry;
}

}  // namespace v3d::recon
