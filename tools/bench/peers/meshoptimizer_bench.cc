// meshoptimizer's codecs on the coloured mesh of encode/10mm.
//
// It keeps what our compact frame keeps: positions as whole half voxels, 16 bits an axis, and
// colours as they are, 12 bytes a vertex. Its codecs want triangles and vertices in an order of its
// own making (vertex cache, then vertex fetch), so that ordering is part of the time; laying the
// vertices out is not. Its documentation has a general compressor follow; none does here.
#include <meshoptimizer.h>

#include <array>

#include "rates.h"
#include "workload.h"

namespace v3d::bench {
namespace {

struct Vertex {
  std::array<uint16_t, 4> half_voxels;  ///< the last is padding
  std::array<uint8_t, 4> colour;        ///< as well
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

/// Encodes one frame; its working memory stays.
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
