#include "recon/mesh/neighbours.h"

namespace v3d {

// Every edge of a closed mesh is run along once in each direction: the corners that follow a
// vertex in its triangles are its neighbours.
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

}  // namespace v3d
