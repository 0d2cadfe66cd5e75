#include "codec/known_vertices.h"

namespace v3d {

void KnownVertices::make(std::span<const std::array<uint32_t, 3>> triangles, uint32_t vertices) {
  known_.assign(vertices, {});
  for (const auto& [a, b, c] : triangles) {
    add(a, b);
    add(b, c);
    add(c, a);
  }
  for (uint32_t vertex = 0; vertex < vertices; ++vertex) {
    known_[vertex].repeat(vertex - uint32_t{vertex > 0});
  }
}

}  // namespace v3d
