#include "v3dctl/export/meshopt_compression.h"

#include <meshoptimizer.h>

#include <stdexcept>

namespace v3d::ctl {
namespace {

void cut_to(size_t written, std::vector<uint8_t>& bytes) {
  if (written == 0) throw std::runtime_error("meshoptimizer cannot encode the mesh");
  bytes.resize(written);
}

}  // namespace

void order_for_meshopt(VertexStreams& mesh) {
  std::vector<uint32_t>& indices = mesh.indices;
  meshopt_optimizeVertexCache(indices.data(), indices.data(), indices.size(), mesh.vertices);
  std::vector<unsigned> place(mesh.vertices);
  const size_t used =
      meshopt_optimizeVertexFetchRemap(place.data(), indices.data(), indices.size(), mesh.vertices);
  meshopt_remapIndexBuffer(indices.data(), indices.data(), indices.size(), place.data());
  for (VertexStream& stream : mesh.streams) {
    std::vector<uint8_t> ordered(used * stream.stride);
    meshopt_remapVertexBuffer(ordered.data(), stream.bytes.data(), mesh.vertices, stream.stride,
                              place.data());
    stream.bytes = std::move(ordered);
  }
  mesh.vertices = used;
}

std::vector<uint8_t> compress_vertices(const VertexStream& stream, size_t vertices) {
  meshopt_encodeVertexVersion(0);
  std::vector<uint8_t> bytes(meshopt_encodeVertexBufferBound(vertices, stream.stride));
  cut_to(meshopt_encodeVertexBuffer(bytes.data(), bytes.size(), stream.bytes.data(), vertices,
                                    stream.stride),
         bytes);
  return bytes;
}

std::vector<uint8_t> compress_triangles(std::span<const uint32_t> indices, size_t vertices) {
  meshopt_encodeIndexVersion(1);
  std::vector<uint8_t> bytes(meshopt_encodeIndexBufferBound(indices.size(), vertices));
  cut_to(meshopt_encodeIndexBuffer(bytes.data(), bytes.size(), indices.data(), indices.size()),
         bytes);
  return bytes;
}

}  // namespace v3d::ctl
