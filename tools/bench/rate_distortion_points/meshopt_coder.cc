#include <meshoptimizer.h>

#include <cmath>
#include <stdexcept>

#include "coder.h"

namespace v3d::bench {
namespace {

struct Vertex {
  std::array<uint16_t, 4> place;  ///< the last element is padding
  std::array<uint8_t, 4> levels;  ///< the last element is padding
};

std::vector<Vertex> vertices_of(const Mesh& mesh, const Accuracy& accuracy) {
  std::vector<Vertex> vertices;
  for (size_t v = 0; v < mesh.vertices.size(); ++v) {
    const Eigen::Vector3d steps =
        (mesh.vertices[v].cast<double>() - accuracy.origin) / accuracy.step_m;
    Vertex& vertex = vertices.emplace_back();
    for (int axis = 0; axis < 3; ++axis) {
      const double place = std::round(steps[axis]);
      if (place < 0 || place > 65535)
        throw std::runtime_error("meshoptimizer: an axis has more than 65,536 steps");
      vertex.place[axis] = static_cast<uint16_t>(place);
    }
    if (accuracy.colour_step == 0) continue;
    const Rgb8 c = mesh.colours[v];
    vertex.levels = {level_of(c.r, accuracy.colour_step), level_of(c.g, accuracy.colour_step),
                     level_of(c.b, accuracy.colour_step), 0};
  }
  return vertices;
}

std::vector<uint8_t> encode(std::vector<Vertex> vertices, const Mesh& mesh) {
  std::vector<unsigned> indices;
  for (const auto& t : mesh.triangles) indices.insert(indices.end(), t.begin(), t.end());
  meshopt_optimizeVertexCache(indices.data(), indices.data(), indices.size(), vertices.size());
  std::vector<Vertex> ordered(vertices.size());
  meshopt_optimizeVertexFetch(ordered.data(), indices.data(), indices.size(), vertices.data(),
                              vertices.size(), sizeof(Vertex));
  std::vector<uint8_t> bytes(meshopt_encodeVertexBufferBound(ordered.size(), sizeof(Vertex)) +
                             meshopt_encodeIndexBufferBound(indices.size(), ordered.size()));
  size_t size = meshopt_encodeVertexBuffer(bytes.data(), bytes.size(), ordered.data(),
                                           ordered.size(), sizeof(Vertex));
  size += meshopt_encodeIndexBuffer(bytes.data() + size, bytes.size() - size, indices.data(),
                                    indices.size());
  bytes.resize(size);
  return bytes;
}

}  // namespace

MeshoptCoded code_with_meshopt(const Mesh& mesh, const Accuracy& accuracy) {
  const std::vector<Vertex> vertices = vertices_of(mesh, accuracy);
  MeshoptCoded coded;
  coded.stream = encode(vertices, mesh);
  coded.bytes = coded.stream.size();
  for (const Vertex& vertex : vertices) {  // the codec is lossless
    VertexPosition& position = coded.positions.emplace_back();
    for (int axis = 0; axis < 3; ++axis) {
      position[axis] =
          static_cast<float>(accuracy.origin[axis] + vertex.place[axis] * accuracy.step_m);
    }
    if (accuracy.colour_step == 0) continue;
    VertexColour& colour = coded.colours.emplace_back();
    for (int k = 0; k < 3; ++k) {
      colour[k] = channel_of(vertex.levels[k], accuracy.colour_step);
    }
  }
  return coded;
}

}  // namespace v3d::bench
