// Benchmark of Draco on the coloured mesh of encode/10mm and decode/10mm, at the same error.
//
// The encoded content equals that of our compact frame: positions on the same lattice of half
// voxels (quantised to the bits that the lattice needs), colours to 38.1 dB (ours: 38.5). The
// conversion to draco::Mesh is not timed. Edgebreaker connectivity, measured at the default speed,
// 5 of 10, and at speed 0, which gives the smallest files.
#include <draco/compression/decode.h>
#include <draco/compression/encode.h>
#include <draco/mesh/mesh.h>
#include <meshoptimizer.h>

#include <array>
#include <bit>
#include <memory>

#include "rates.h"
#include "workload.h"

namespace v3d::bench {
namespace {

void add_attribute(draco::Mesh& mesh, draco::GeometryAttribute::Type type, draco::DataType data,
                   int component_bytes, const void* values, size_t count) {
  draco::GeometryAttribute attribute;
  attribute.Init(type, nullptr, 3, data, type == draco::GeometryAttribute::COLOR,
                 3 * component_bytes, 0);
  const int id = mesh.AddAttribute(attribute, true, static_cast<uint32_t>(count));
  mesh.attribute(id)->buffer()->Write(0, values, count * 3 * component_bytes);
}

std::unique_ptr<draco::Mesh> to_draco(const Mesh& mesh) {
  auto out = std::make_unique<draco::Mesh>();
  out->set_num_points(static_cast<uint32_t>(mesh.vertices.size()));
  for (const auto& triangle : mesh.triangles) {
    out->AddFace({draco::PointIndex(triangle[0]), draco::PointIndex(triangle[1]),
                  draco::PointIndex(triangle[2])});
  }
  add_attribute(*out, draco::GeometryAttribute::POSITION, draco::DT_FLOAT32, sizeof(float),
                mesh.vertices.data(), mesh.vertices.size());
  add_attribute(*out, draco::GeometryAttribute::COLOR, draco::DT_UINT8, 1, mesh.colours.data(),
                mesh.colours.size());
  return out;
}

/// Quantisation step of colours; a decoder multiplies by it. It causes a mean squared error of
/// (11 * 11 - 1) / 12.
constexpr int kColourStep = 11;

std::vector<Rgb8> quantised(std::vector<Rgb8> colours) {
  const auto level = [](uint8_t c) {
    return static_cast<uint8_t>((c + kColourStep / 2) / kColourStep);
  };
  for (Rgb8& c : colours) c = {level(c.r), level(c.g), level(c.b)};
  return colours;
}

/// Quantises such that every lattice point is restored exactly.
void quantise_to(const recon::CompactFrame& frame, draco::Encoder& encoder) {
  const Eigen::Vector3f origin = frame.lattice.origin.cast<float>();
  float extent = 0;
  for (const Eigen::Vector3f& v : frame.mesh.vertices) {
    extent = std::max(extent, (v - origin).maxCoeff());
  }
  const auto steps = static_cast<unsigned>(std::lround(extent / frame.lattice.step));
  const int bits = std::bit_width(steps);
  const auto range = static_cast<float>(((1U << bits) - 1) * frame.lattice.step);
  encoder.SetAttributeExplicitQuantization(draco::GeometryAttribute::POSITION, bits, 3,
                                           origin.data(), range);
}

std::unique_ptr<draco::Mesh> draco_mesh() {
  Mesh mesh = compact_frame_10mm().mesh;
  mesh.colours = quantised(std::move(mesh.colours));
  return to_draco(mesh);
}

void draco_encode(benchmark::State& state, int speed) {
  const auto mesh = draco_mesh();
  draco::Encoder encoder;
  encoder.SetSpeedOptions(speed, speed);
  quantise_to(compact_frame_10mm(), encoder);
  draco::EncoderBuffer buffer;
  measure(state, 1, 0, [&] {
    buffer.Clear();
    if (!encoder.EncodeMeshToBuffer(*mesh, &buffer).ok())
      state.SkipWithError("the mesh cannot be encoded");
  });
  state.counters["frame_bytes"] = static_cast<double>(buffer.size());
}

void draco_decode(benchmark::State& state, int speed) {
  draco::Encoder encoder;
  encoder.SetSpeedOptions(speed, speed);
  quantise_to(compact_frame_10mm(), encoder);
  draco::EncoderBuffer encoded;
  if (!encoder.EncodeMeshToBuffer(*draco_mesh(), &encoded).ok()) {
    state.SkipWithError("the mesh cannot be encoded");
  }
  draco::Decoder decoder;
  measure(state, 1, static_cast<double>(encoded.size()), [&] {
    draco::DecoderBuffer buffer;
    buffer.Init(encoded.data(), encoded.size());
    auto decoded = decoder.DecodeMeshFromBuffer(&buffer);
    if (!decoded.ok()) state.SkipWithError("the mesh cannot be decoded");
    benchmark::DoNotOptimize(decoded);
  });
}

BENCHMARK_CAPTURE(draco_encode, usual, 5)->Name("peer/draco_encode/10mm");
BENCHMARK_CAPTURE(draco_decode, usual, 5)->Name("peer/draco_decode/10mm");
BENCHMARK_CAPTURE(draco_encode, smallest, 0)->Name("peer/draco_encode/10mm/smallest");
BENCHMARK_CAPTURE(draco_decode, smallest, 0)->Name("peer/draco_decode/10mm/smallest");

}  // namespace

// Benchmark of meshoptimizer's codecs on the coloured mesh of encode/10mm.
//
// The encoded content equals that of our compact frame: positions in half voxels, 16 bits an axis,
// and colours without loss, 12 bytes a vertex. The codecs need an optimised order of triangles and
// vertices (vertex cache, then vertex fetch); the time includes this ordering, but not the vertex
// layout. Its documentation recommends a general compressor afterwards; none is used here.

namespace {

struct Vertex {
  std::array<uint16_t, 4> half_voxels;  ///< the last element is padding
  std::array<uint8_t, 4> colour;        ///< the last element is padding
};
static_assert(sizeof(Vertex) == 12);

std::vector<Vertex> vertices_of(const recon::CompactFrame& frame) {
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
