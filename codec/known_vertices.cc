#include "codec/known_vertices.h"

namespace v3d {

void KnownVertices::make(std::span<const std::array<uint32_t, 3>> triangles, uint32_t vertices) {
  known_.assign(vertices, {});
  for (const auto& [a, b, c] : triangles) {
    add(a, b);
    add(b, c);
    add(c, a);
  }
  for (uint32_t vertex = 1; vertex < vertices; ++vertex) {
    if (known_[vertex].count == 0) known_[vertex] = {1, {vertex - 1}};
  }
}

}  // namespace v3d
