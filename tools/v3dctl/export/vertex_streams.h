// Vertex streams of a glTF mesh: one array of numbers for each attribute, and their compression.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "base/geometry/mesh.h"
#include "recon/texture/texture_atlas.h"

namespace v3d::ctl {

/// Component types with their numbers in glTF.
enum class Component { kUint8 = 5121, kUint16 = 5123, kFloat = 5126 };

struct VertexStream {
  std::string semantic;  ///< "POSITION", "COLOR_0", ...
  Component component;
  int width = 3;            ///< components of a vertex
  bool normalised = false;  ///< integers represent 0 to 1
  size_t stride = 0;        ///< bytes from vertex to vertex, a multiple of 4; unused bytes are 0
  std::vector<uint8_t> bytes;
};

struct VertexStreams {
  size_t vertices = 0;
  std::vector<VertexStream> streams;
  std::vector<uint32_t> indices;  ///< three for each triangle
};

/// Stream of `values`, `width` for each vertex. Requires the C++ type of `component`.
template <class T>
VertexStream make_stream(std::string semantic, Component component, int width,
                         const std::vector<T>& values) {
  const size_t filled = sizeof(T) * static_cast<size_t>(width);
  VertexStream stream{.semantic = std::move(semantic),
                      .component = component,
                      .width = width,
                      .normalised = component != Component::kFloat,
                      .stride = (filled + 3) / 4 * 4,
                      .bytes = {}};
  const size_t vertices = values.size() / static_cast<size_t>(width);
  stream.bytes.resize(vertices * stream.stride);
  const auto* from = reinterpret_cast<const uint8_t*>(values.data());
  for (size_t v = 0; v < vertices; ++v) {
    std::copy_n(from + v * filled, filled, stream.bytes.data() + v * stream.stride);
  }
  return stream;
}

/// Positions as integers: world = origin + position * step, for each axis.
struct PositionGrid {
  Eigen::Vector3d origin = Eigen::Vector3d::Zero();  ///< metres
  double step = 1;                                   ///< metres
  uint16_t last = 0;                                 ///< greatest coordinate of a position
  std::vector<std::array<uint16_t, 3>> positions;
};

/// Quantises vertices to the steps of `lattice`, which is exact. Where the lattice is unknown (a
/// step of 0), or has more than 65,536 steps along an axis, the step is as small as 16 bits allow.
PositionGrid quantise(const std::vector<Eigen::Vector3f>& vertices, const VertexLattice& lattice);

/// Linear light of an sRGB value, 0 to 1. Twelve bits distinguish all 256 values of sRGB.
double linear_light(uint8_t srgb);
inline constexpr int kLinearBits = 12;

/// Linear light of the colours of a mesh from 0 to `max`, rounded, `width` (3 or 4) for each
/// vertex; the fourth is `max`.
template <class T>
std::vector<T> linear_light(const Mesh& mesh, int width, double max) {
  std::vector<T> values;
  for (const Rgb8 c : mesh.colours) {
    for (const uint8_t channel : {c.r, c.g, c.b}) {
      values.push_back(static_cast<T>(std::round(max * linear_light(channel))));
    }
    if (width == 4) values.push_back(static_cast<T>(max));
  }
  return values;
}

/// POSITION in floats, metres.
VertexStream float_positions(const Mesh& mesh);
/// COLOR_0 with 16 bits and alpha. Requires a mesh with colours.
VertexStream linear_colours(const Mesh& mesh);

/// A surface with texture coordinates. A vertex at a seam occurs once for each chart that it
/// belongs to.
struct TexturedMesh {
  Mesh mesh;  ///< without colours; the triangles in the order of the original
  /// One per vertex: u to the right and v downwards as in glTF, from 0 to 65535 over the image.
  std::vector<std::array<uint16_t, 2>> coordinates;
  std::vector<uint32_t> source;  ///< one per vertex: its number in the original
};

/// Leaves out vertices without a triangle. `layout` is that of the mesh.
TexturedMesh with_coordinates(const Mesh& mesh, const recon::AtlasLayout& layout);
/// TEXCOORD_0
VertexStream texture_coordinates(const TexturedMesh& textured);

// --- EXT_meshopt_compression: vertex_streams.cc

/// Reorders triangles and vertices for the codecs. Removes vertices without a triangle.
void order_for_meshopt(VertexStreams& mesh);
/// Version 0 of the vertex codec and version 1 of the index codec, as the extension requires. Throw
/// std::runtime_error when the mesh cannot be encoded.
std::vector<uint8_t> compress_vertices(const VertexStream& stream, size_t vertices);
std::vector<uint8_t> compress_triangles(std::span<const uint32_t> indices, size_t vertices);

// --- KHR_draco_mesh_compression: draco_compression.cc

/// A compressed mesh. Decoders get vertices and triangles in another order.
struct DracoMesh {
  std::vector<uint8_t> bytes;
  std::vector<int> ids;  ///< of the attributes, in the order of the streams
  size_t vertices = 0;
  size_t triangles = 0;
  Eigen::Vector3f low, high;  ///< bounds of the decoded positions, metres
};

/// Compresses with the best ratio. Requires POSITION as floats, which are decoded on `grid`,
/// COLOR_0 as floats from 0 to 1, which keep kLinearBits, and other attributes as bytes, which are
/// lossless. Degenerate triangles and vertices without a triangle are removed. Throws
/// std::runtime_error when Draco cannot encode the mesh, for instance without triangles.
DracoMesh compress_with_draco(const VertexStreams& mesh, const PositionGrid& grid);

}  // namespace v3d::ctl
