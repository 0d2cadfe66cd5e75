#include "common/obj_file.h"

#include <tiny_obj_loader.h>

#include "base/core/error.h"
#include "base/io/file.h"

namespace v3d {

Mesh read_obj(const std::filesystem::path& path) {
  tinyobj::ObjReaderConfig config;
  config.vertex_color = false;
  tinyobj::ObjReader reader;
  if (!reader.ParseFromString(read_file(path), "", config)) {
    throw InputError(path.string() + ": is no OBJ file: " + reader.Error());
  }
  Mesh mesh;
  const std::vector<tinyobj::real_t>& positions = reader.GetAttrib().vertices;
  for (size_t i = 0; i + 2 < positions.size(); i += 3) {
    mesh.vertices.emplace_back(positions[i], positions[i + 1], positions[i + 2]);
    if (!mesh.vertices.back().allFinite()) {
      throw InputError(path.string() + ": vertex " + std::to_string(i / 3 + 1) + " is not finite");
    }
  }
  for (const tinyobj::shape_t& shape : reader.GetShapes()) {
    const std::vector<tinyobj::index_t>& corners = shape.mesh.indices;
    for (size_t i = 0; i + 2 < corners.size(); i += 3) {
      std::array<uint32_t, 3> triangle;
      for (size_t k = 0; k < triangle.size(); ++k) {
        const int vertex = corners[i + k].vertex_index;
        if (vertex < 0 || static_cast<size_t>(vertex) >= mesh.vertices.size()) {
          throw InputError(path.string() + ": a face names vertex " + std::to_string(vertex + 1) +
                           " of " + std::to_string(mesh.vertices.size()));
        }
        triangle[k] = static_cast<uint32_t>(vertex);
      }
      mesh.triangles.push_back(triangle);
    }
  }
  if (mesh.triangles.empty()) throw InputError(path.string() + ": has no face");
  return mesh;
}

}  // namespace v3d
