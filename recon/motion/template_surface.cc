#include "recon/motion/template_surface.h"

#include <meshoptimizer.h>

#include <cstdint>
#include <limits>
#include <vector>

namespace v3d::recon {

Mesh simplified(const Mesh& mesh, size_t triangles) {
  std::vector<uint32_t> indices;
  indices.reserve(3 * mesh.triangles.size());
  for (const auto& t : mesh.triangles) indices.insert(indices.end(), t.begin(), t.end());
  std::vector<uint32_t> kept = indices;
  if (mesh.triangles.size() > triangles) {
    kept.resize(meshopt_simplify(kept.data(), indices.data(), indices.size(), &mesh.vertices[0].x(),
                                 mesh.vertices.size(), sizeof(mesh.vertices[0]), 3 * triangles,
                                 std::numeric_limits<float>::max(), 0, nullptr));
  }

  constexpr auto kUnused = std::numeric_limits<uint32_t>::max();
  std::vector<uint32_t> number(mesh.vertices.size(), kUnused);
  Mesh small;
  for (size_t i = 0; i < kept.size(); ++i) {
    uint32_t& vertex = number[kept[i]];
    if (vertex == kUnused) {
      vertex = static_cast<uint32_t>(small.vertices.size());
      small.vertices.push_back(mesh.vertices[kept[i]]);
      if (!mesh.colours.empty()) small.colours.push_back(mesh.colours[kept[i]]);
    }
    if (i % 3 == 2) {
      small.triangles.push_back({number[kept[i - 2]], number[kept[i - 1]], vertex});
    }
  }
  return small;
}

}  // namespace v3d::recon
