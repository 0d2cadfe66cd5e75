// A mesh as glTF describes one to a graphics card: one array of numbers for each of its attributes.
#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <vector>

#include "base/mesh.h"
#include "recon/vertex_lattice.h"

namespace v3d::ctl {

/// By the numbers that glTF gives them.
enum class Component { kUint8 = 5121, kUint16 = 5123, kFloat = 5126 };
size_t bytes_of(Component component);

struct VertexStream {
  std::string semantic;  ///< "POSITION", "COLOR_0", ...
  Component component;
  int width = 3;            ///< components of a vertex
  bool normalised = false;  ///< whole numbers stand for 0 to 1
  size_t stride = 0;        ///< bytes from vertex to vertex, a multiple of 4; those not used are 0
  std::vector<uint8_t> bytes;
};

struct VertexStreams {
  size_t vertices = 0;
  std::vector<VertexStream> streams;
  std::vector<uint32_t> indices;  ///< three for each triangle
};

/// The same numbers behind each other: `values` has `width` for each vertex. Requires that they are
/// of the component's type.
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

/// Positions as whole numbers: world = origin + place * step, per axis.
struct PositionGrid {
  Eigen::Vector3d origin = Eigen::Vector3d::Zero();
  double step = 1;
  uint16_t last = 0;  ///< the greatest of the places
  std::vector<std::array<uint16_t, 3>> places;
};

/// On the lattice that the vertices lie on, which loses nothing, or, where that is unknown (a step
/// of 0) or has more than 65,536 steps along an axis, on one so coarse that it has fewer.
PositionGrid place_on_grid(const std::vector<Eigen::Vector3f>& vertices,
                           const VertexLattice& lattice);

/// glTF's colours are linear light, 0 to 1. Twelve bits of it tell all 256 values of sRGB apart.
double linear_light(uint8_t srgb);
inline constexpr int kLinearBits = 12;

}  // namespace v3d::ctl
