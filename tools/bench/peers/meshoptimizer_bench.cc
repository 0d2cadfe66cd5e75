// Benchmark of meshoptimizer's codecs on the coloured mesh of encode/10mm.
//
// The encoded content equals that of our compact frame: positions in half voxels, 16 bits an axis,
// and colours without loss, 12 bytes a vertex. The codecs need an optimised order of triangles and
// vertices (vertex cache, then vertex fetch); the time includes this ordering, but not the vertex
// layout. Its documentation recommends a general compressor afterwards; none is used here.
#include <meshoptimizer.h>

#include <array>

#include "rates.h"
#include "workload.h"

namespace v3d::bench {
namespace {

struct Vertex {
  std::array<uint16_t, 4> half_voxels;  ///< the last element is padding
  std::array<uint8_t, 4> colour;        ///< the last element is padding
};
static_assert(sizeof(Vertex) == 12);

std::vector<Vertex> vertices_of(const CompactFrame& frame) {
  std::vector<Vertex> vertices;
  for (size_t n = 0; n < frame.mesh.vertices.size(); ++n) {
    const Eigen::Vector3d steps =
        (frame.mesh.vertices[n].cast<double>() - frame.lattice.origin) / frame.lattice.step;
    const auto at = steps.array().round().cast<uint16_t>().eval();
    const Rgb8 colour = frame.mesh.colours[n];
    vertices.push_back({{at.x(), at.y(), at.z(), 0}, {colour.r, colour.g, colour.b, 0}});
  }
  return vertices;
}

std::vector<unsigned> indices_of(const Mesh& mesh) {
  std::vector<unsigned> indices;
  for (const auto& triangle : mesh.triangles) {
    indices.insert(indices.end(), triangle.begin(), triangle.end());
  }
  return indices;
}

/// Encodes frames and reuses its working memory.
class MeshoptEncoder {
 public:
  /// Returns the number of bytes.
  size_t encode(const std::vector<Vertex>& vertices, const std::vector<unsigned>& indices) {
    order(vertices, indices);
    bytes_.resize(meshopt_encodeVertexBufferBound(ordered_.size(), sizeof(Vertex)) +
                  meshopt_encodeIndexBufferBound(indices_.size(), ordered_.size()));
    const size_t size = meshopt_encodeVertexBuffer(bytes_.data(), bytes_.size(), ordered_.data(),
                                                   ordered_.size(), sizeof(Vertex));
    return size + meshopt_encodeIndexBuffer(bytes_.data() + size, bytes_.size() - size,
                                            indices_.data(), indices_.size());
  }

 private:
  void order(const std::vector<Vertex>& vertices, const std::vector<unsigned>& indices) {
    indices_.resize(indices.size());
    ordered_.resize(vertices.size());
    meshopt_optimizeVertexCache(indices_.data(), indices.data(), indices.size(), vertices.size());
    meshopt_optimizeVertexFetch(ordered_.data(), indices_.data(), indices_.size(), vertices.data(),
                                vertices.size(), sizeof(Vertex));
  }

  std::vector<Vertex> ordered_;
  std::vector<unsigned> indices_;
  std::vector<unsigned char> bytes_;
};

void meshopt_encode(benchmark::State& state) {
  const std::vector<Vertex> vertices = vertices_of(compact_frame_10mm());
  const std::vector<unsigned> indices = indices_of(compact_frame_10mm().mesh);
  MeshoptEncoder encoder;
  size_t size = 0;
  measure(state, 1, 0, [&] { size = encoder.encode(vertices, indices); });
  state.counters["frame_bytes"] = static_cast<double>(size);
}

BENCHMARK(meshopt_encode)->Name("peer/meshopt_encode/10mm");

}  // namespace
}  // namespace v3d::bench
