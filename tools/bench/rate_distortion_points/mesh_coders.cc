#include <draco/compression/decode.h>
#include <draco/compression/encode.h>
#include <draco/mesh/mesh.h>
#include <meshoptimizer.h>

#include <bit>
#include <cmath>
#include <memory>
#include <stdexcept>

#include "coder.h"

namespace v3d::bench {
namespace {

template <class T>
void add_attribute(draco::Mesh& mesh, draco::GeometryAttribute::Type type, draco::DataType data,
                   int width, const std::vector<T>& values) {
  draco::GeometryAttribute attribute;
  const size_t bytes = sizeof(T) * static_cast<size_t>(width);
  attribute.Init(type, nullptr, static_cast<uint8_t>(width), data, false,
                 static_cast<int64_t>(bytes), 0);
  const auto count = static_cast<uint32_t>(mesh.num_points());
  const int id = mesh.AddAttribute(attribute, true, count);
  mesh.attribute(id)->buffer()->Write(0, values.data(), count * bytes);
}

/// `numbered`: adds the vertex numbers, to restore the order after decoding.
std::unique_ptr<draco::Mesh> to_draco(const Mesh& mesh, int colour_step, bool numbered) {
  auto out = std::make_unique<draco::Mesh>();
  out->set_num_points(static_cast<uint32_t>(mesh.vertices.size()));
  for (const auto& t : mesh.triangles) {
    out->AddFace({draco::PointIndex(t[0]), draco::PointIndex(t[1]), draco::PointIndex(t[2])});
  }
  add_attribute(*out, draco::GeometryAttribute::POSITION, draco::DT_FLOAT32, 3,
                std::vector<float>(mesh.vertices.data()->data(),
                                   mesh.vertices.data()->data() + 3 * mesh.vertices.size()));
  if (colour_step > 0) {
    std::vector<uint8_t> levels;
    for (const Rgb8 c : mesh.colours) {
      for (const uint8_t channel : {c.r, c.g, c.b})
        levels.push_back(level_of(channel, colour_step));
    }
    add_attribute(*out, draco::GeometryAttribute::COLOR, draco::DT_UINT8, 3, levels);
  }
  if (numbered) {
    std::vector<uint32_t> numbers(mesh.vertices.size());
    for (uint32_t v = 0; v < numbers.size(); ++v) numbers[v] = v;
    add_attribute(*out, draco::GeometryAttribute::GENERIC, draco::DT_UINT32, 1, numbers);
  }
  return out;
}

void quantise_to(const Mesh& mesh, const Accuracy& accuracy, draco::Encoder& encoder) {
  const Eigen::Vector3f origin = accuracy.origin.cast<float>();
  float extent = 0;
  for (const Eigen::Vector3f& v : mesh.vertices) {
    extent = std::max(extent, (v - origin).maxCoeff());
  }
  const auto steps = static_cast<unsigned>(std::ceil(extent / accuracy.step_m));
  const int bits = std::bit_width(steps);
  const auto range = static_cast<float>(((1U << bits) - 1) * accuracy.step_m);
  encoder.SetAttributeExplicitQuantization(draco::GeometryAttribute::POSITION, bits, 3,
                                           origin.data(), range);
}

void encode(const Mesh& mesh, const Accuracy& accuracy, int speed, bool numbered,
            draco::EncoderBuffer& buffer) {
  draco::Encoder encoder;
  encoder.SetSpeedOptions(speed, speed);
  quantise_to(mesh, accuracy, encoder);
  if (!encoder.EncodeMeshToBuffer(*to_draco(mesh, accuracy.colour_step, numbered), &buffer).ok()) {
    throw std::runtime_error("Draco cannot encode the mesh");
  }
}

}  // namespace

Coded code_with_draco(const Mesh& mesh, const Accuracy& accuracy, int speed) {
  Coded coded;
  draco::EncoderBuffer bytes, numbered;
  encode(mesh, accuracy, speed, false, bytes);
  coded.bytes = bytes.size();
  encode(mesh, accuracy, speed, true, numbered);
  draco::DecoderBuffer buffer;
  buffer.Init(numbered.data(), numbered.size());
  draco::Decoder decoder;
  auto decoded = decoder.DecodeMeshFromBuffer(&buffer);
  if (!decoded.ok()) throw std::runtime_error("Draco cannot decode its own output");
  const draco::Mesh& found = *decoded.value();
  const auto value = [&](draco::GeometryAttribute::Type type, uint32_t point, auto* into) {
    const draco::PointAttribute* attribute = found.GetNamedAttribute(type);
    attribute->GetValue(attribute->mapped_index(draco::PointIndex(point)), into);
  };
  coded.positions.resize(mesh.vertices.size());
  if (accuracy.colour_step > 0) coded.colours.resize(mesh.vertices.size());
  for (uint32_t point = 0; point < found.num_points(); ++point) {
    uint32_t v = 0;
    value(draco::GeometryAttribute::GENERIC, point, &v);
    value(draco::GeometryAttribute::POSITION, point, coded.positions[v].data());
    if (accuracy.colour_step == 0) continue;
    uint8_t levels[3];
    value(draco::GeometryAttribute::COLOR, point, levels);
    for (int k = 0; k < 3; ++k) coded.colours[v][k] = channel_of(levels[k], accuracy.colour_step);
  }
  return coded;
}

namespace {

struct Vertex {
  std::array<uint16_t, 4> position;  ///< in steps; the last element is padding
  std::array<uint8_t, 4> levels;     ///< the last element is padding
};

std::vector<Vertex> vertices_of(const Mesh& mesh, const Accuracy& accuracy) {
  std::vector<Vertex> vertices;
  for (size_t v = 0; v < mesh.vertices.size(); ++v) {
    const Eigen::Vector3d steps =
        (mesh.vertices[v].cast<double>() - accuracy.origin) / accuracy.step_m;
    Vertex& vertex = vertices.emplace_back();
    for (int axis = 0; axis < 3; ++axis) {
      const double coordinate = std::round(steps[axis]);
      if (coordinate < 0 || coordinate > 65535)
        throw std::runtime_error("meshoptimizer: an axis has more than 65,536 steps");
      vertex.position[axis] = static_cast<uint16_t>(coordinate);
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
    codec::VertexPosition& position = coded.positions.emplace_back();
    for (int axis = 0; axis < 3; ++axis) {
      position[axis] =
          static_cast<float>(accuracy.origin[axis] + vertex.position[axis] * accuracy.step_m);
    }
    if (accuracy.colour_step == 0) continue;
    codec::VertexColour& colour = coded.colours.emplace_back();
    for (int k = 0; k < 3; ++k) {
      colour[k] = channel_of(vertex.levels[k], accuracy.colour_step);
    }
  }
  return coded;
}

}  // namespace v3d::bench
