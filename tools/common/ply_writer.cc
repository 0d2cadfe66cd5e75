#include "common/ply_writer.h"

#include <bit>
#include <string>

#include "base/io/whole_file.h"

namespace v3d {
namespace {

static_assert(std::endian::native == std::endian::little, "PLY is written as it lies in memory");

template <class T>
void put(std::string& bytes, const T& value) {
  bytes.append(reinterpret_cast<const char*>(&value), sizeof value);
}

std::string ply_header(const Mesh& mesh, std::span<const PlyColours> more) {
  std::string header = "ply\nformat binary_little_endian 1.0\ncomment metres, z up\n";
  for (const PlyColours& colours : more) header += "comment " + colours.comment + "\n";
  header += "element vertex " + std::to_string(mesh.vertices.size()) +
            "\nproperty float x\nproperty float y\nproperty float z\n";
  if (!mesh.colours.empty()) {
    header += "property uchar red\nproperty uchar green\nproperty uchar blue\n";
  }
  for (const PlyColours& colours : more) {
    for (const std::string& name : colours.properties) header += "property uchar " + name + "\n";
  }
  return header + "element face " + std::to_string(mesh.triangles.size()) +
         "\nproperty list uchar int vertex_indices\nend_header\n";
}

}  // namespace

void write_ply(const std::filesystem::path& path, const Mesh& mesh,
               std::span<const PlyColours> more) {
  std::string bytes = ply_header(mesh, more);
  for (size_t i = 0; i < mesh.vertices.size(); ++i) {
    for (int axis = 0; axis < 3; ++axis) put(bytes, mesh.vertices[i][axis]);
    if (!mesh.colours.empty()) put(bytes, mesh.colours[i]);
    for (const PlyColours& colours : more) put(bytes, colours.vertices[i]);
  }
  for (const std::array<uint32_t, 3>& triangle : mesh.triangles) {
    put(bytes, uint8_t{3});
    for (const uint32_t vertex : triangle) put(bytes, static_cast<int32_t>(vertex));
  }
  replace_file(path, bytes);
}

}  // namespace v3d
