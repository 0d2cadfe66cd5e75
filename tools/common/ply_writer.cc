#include "v3d-sim/ply.h"

#include <bit>
#include <string>

#include "base/file.h"

namespace v3d::sim {
namespace {

static_assert(std::endian::native == std::endian::little);

template <class T>
void put(std::string& bytes, const T& value) {
  bytes.append(reinterpret_cast<const char*>(&value), sizeof value);
}

}  // namespace

void write_ply(const std::filesystem::path& path, const Mesh& mesh) {
  const bool coloured = !mesh.colours.empty();
  std::string bytes = "ply\nformat binary_little_endian 1.0\nelement vertex " +
                      std::to_string(mesh.vertices.size()) +
                      "\nproperty float x\nproperty float y\nproperty float z\n";
  if (coloured) {
    bytes += "property uchar red\nproperty uchar green\nproperty uchar blue\n";
  }
  bytes += "element face " + std::to_string(mesh.triangles.size()) +
           "\nproperty list uchar int vertex_indices\nend_header\n";
  for (size_t i = 0; i < mesh.vertices.size(); ++i) {
    put(bytes, mesh.vertices[i].x());
    put(bytes, mesh.vertices[i].y());
    put(bytes, mesh.vertices[i].z());
    if (coloured) {
      put(bytes, mesh.colours[i].r);
      put(bytes, mesh.colours[i].g);
      put(bytes, mesh.colours[i].b);
    }
  }
  for (const auto& triangle : mesh.triangles) {
    put(bytes, uint8_t{3});
    for (const uint32_t index : triangle) {
      put(bytes, static_cast<int32_t>(index));
    }
  }
  replace_file(path, bytes);
}

}  // namespace v3d::sim
