#include "v3dctl/export/vertex_streams.h"

#include <meshoptimizer.h>

#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <unordered_map>

namespace v3d::ctl {
namespace {

constexpr double kMaxSteps = 65535;

/// Position in steps of `lattice` from its origin, rounded.
Eigen::Vector3d steps_to(const Eigen::Vector3f& vertex, const VertexLattice& lattice) {
  return ((vertex.cast<double>() - lattice.origin) / lattice.step).array().round();
}

void resize_to(size_t written, std::vector<uint8_t>& bytes) {
  if (written == 0) throw std::runtime_error("meshoptimizer cannot encode the mesh");
  bytes.resize(written);
}

/// Texels have their centres at whole numbers, glTF the corner of the image at 0.
std::array<uint16_t, 2> coordinates_of(const Eigen::Vector2f& texel, int side) {
  std::array<uint16_t, 2> coordinates{};
  for (int k = 0; k < 2; ++k) {
    const double part = (double{texel[k]} + 0.5) / side;
    coordinates[static_cast<size_t>(k)] =
        static_cast<uint16_t>(std::lround(std::clamp(part, 0.0, 1.0) * 65535));
  }
  return coordinates;
}

}  // namespace

PositionGrid quantise(const std::vector<Eigen::Vector3f>& vertices, const VertexLattice& lattice) {
  PositionGrid grid;
  if (vertices.empty()) return grid;
  Eigen::Vector3f low = vertices.front(), high = low;
  for (const Eigen::Vector3f& vertex : vertices) {
    low = low.cwiseMin(vertex);
    high = high.cwiseMax(vertex);
  }
  const double extent = (high - low).cast<double>().maxCoeff();
  grid.step = lattice.step;
  if (grid.step > 0) {
    // A vertex is at most half a step from the coarser lattice.
    while (extent / grid.step > kMaxSteps - 1) grid.step *= 2;
    const VertexLattice coarser{lattice.origin, grid.step};
    grid.origin = lattice.origin + grid.step * steps_to(low, coarser);
  } else {
    grid.step = extent > 0 ? extent / kMaxSteps : 1;
    grid.origin = low.cast<double>();
  }
  for (const Eigen::Vector3f& vertex : vertices) {
    const Eigen::Vector3d steps = steps_to(vertex, {grid.origin, grid.step});
    auto& position = grid.positions.emplace_back();
    for (int axis = 0; axis < 3; ++axis) {
      position[axis] = static_cast<uint16_t>(std::clamp(steps[axis], 0.0, kMaxSteps));
      grid.last = std::max(grid.last, position[axis]);
    }
  }
  return grid;
}

TexturedMesh with_coordinates(const Mesh& mesh, const recon::AtlasLayout& layout) {
  TexturedMesh textured;
  textured.mesh.triangles.resize(mesh.triangles.size());
  std::unordered_map<uint64_t, uint32_t> number;  // of a vertex in a chart
  for (size_t t = 0; t < mesh.triangles.size(); ++t) {
    for (size_t k = 0; k < 3; ++k) {
      const uint32_t v = mesh.triangles[t][k];
      const auto next = static_cast<uint32_t>(textured.source.size());
      const auto [at, is_new] = number.emplace(uint64_t{layout.chart[t]} << 32 | v, next);
      if (is_new) {
        textured.source.push_back(v);
        textured.mesh.vertices.push_back(mesh.vertices[v]);
        textured.coordinates.push_back(coordinates_of(layout.corners[t][k], layout.side));
      }
      textured.mesh.triangles[t][k] = at->second;
    }
  }
  return textured;
}

VertexStream texture_coordinates(const TexturedMesh& textured) {
  std::vector<uint16_t> values;
  for (const auto& uv : textured.coordinates) values.insert(values.end(), uv.begin(), uv.end());
  return make_stream("TEXCOORD_0", Component::kUint16, 2, values);
}

double linear_light(uint8_t srgb) {
  const double s = srgb / 255.0;
  return s <= 0.04045 ? s / 12.92 : std::pow((s + 0.055) / 1.055, 2.4);
}

VertexStream float_positions(const Mesh& mesh) {
  std::vector<float> values;
  for (const Eigen::Vector3f& v : mesh.vertices) values.insert(values.end(), v.begin(), v.end());
  return make_stream("POSITION", Component::kFloat, 3, values);
}

VertexStream linear_colours(const Mesh& mesh) {
  return make_stream("COLOR_0", Component::kUint16, 4, linear_light<uint16_t>(mesh, 4, 65535));
}

void order_for_meshopt(VertexStreams& mesh) {
  std::vector<uint32_t>& indices = mesh.indices;
  meshopt_optimizeVertexCache(indices.data(), indices.data(), indices.size(), mesh.vertices);
  std::vector<unsigned> new_index(mesh.vertices);
  const size_t used = meshopt_optimizeVertexFetchRemap(new_index.data(), indices.data(),
                                                       indices.size(), mesh.vertices);
  meshopt_remapIndexBuffer(indices.data(), indices.data(), indices.size(), new_index.data());
  for (VertexStream& stream : mesh.streams) {
    std::vector<uint8_t> ordered(used * stream.stride);
    meshopt_remapVertexBuffer(ordered.data(), stream.bytes.data(), mesh.vertices, stream.stride,
                              new_index.data());
    stream.bytes = std::move(ordered);
  }
  mesh.vertices = used;
}

std::vector<uint8_t> compress_vertices(const VertexStream& stream, size_t vertices) {
  meshopt_encodeVertexVersion(0);
  std::vector<uint8_t> bytes(meshopt_encodeVertexBufferBound(vertices, stream.stride));
  resize_to(meshopt_encodeVertexBuffer(bytes.data(), bytes.size(), stream.bytes.data(), vertices,
                                       stream.stride),
            bytes);
  return bytes;
}

std::vector<uint8_t> compress_triangles(std::span<const uint32_t> indices, size_t vertices) {
  meshopt_encodeIndexVersion(1);
  std::vector<uint8_t> bytes(meshopt_encodeIndexBufferBound(indices.size(), vertices));
  resize_to(meshopt_encodeIndexBuffer(bytes.data(), bytes.size(), indices.data(), indices.size()),
            bytes);
  return bytes;
}

}  // namespace v3d::ctl
