#include "v3dctl/export/textured_mesh.h"

#include <algorithm>
#include <cmath>
#include <unordered_map>

namespace v3d::ctl {
namespace {

/// Texels have their centres at whole numbers, glTF the corner of the image at 0.
std::array<uint16_t, 2> coordinates_of(const Eigen::Vector2f& texel, int side) {
  std::array<uint16_t, 2> coordinates{};
  for (int k = 0; k < 2; ++k) {
    const double part = (double{texel[k]} + 0.5) / side;
    coordinates[static_cast<size_t>(k)] =
        static_cast<uint16_t>(std::lround(std::clamp(part, 0.0, 1.0) * 65535));
  }
  return coordinates;
}

}  // namespace

TexturedMesh with_coordinates(const Mesh& mesh, const recon::AtlasLayout& layout) {
  TexturedMesh textured;
  textured.mesh.triangles.resize(mesh.triangles.size());
  std::unordered_map<uint64_t, uint32_t> number;  // of a vertex in a chart
  for (size_t t = 0; t < mesh.triangles.size(); ++t) {
    for (size_t k = 0; k < 3; ++k) {
      const uint32_t v = mesh.triangles[t][k];
      const auto next = static_cast<uint32_t>(textured.source.size());
      const auto [at, is_new] = number.emplace(uint64_t{layout.chart[t]} << 32 | v, next);
      if (is_new) {
        textured.source.push_back(v);
        textured.mesh.vertices.push_back(mesh.vertices[v]);
        textured.coordinates.push_back(coordinates_of(layout.corners[t][k], layout.side));
      }
      textured.mesh.triangles[t][k] = at->second;
    }
  }
  return textured;
}

}  // namespace v3d::ctl
