#include <draco/compression/decode.h>
#include <draco/compression/encode.h>
#include <draco/mesh/mesh.h>

#include <bit>
#include <memory>
#include <stdexcept>

#include "v3dctl/export/vertex_streams.h"

namespace v3d::ctl {
namespace {

draco::GeometryAttribute::Type type_of(const std::string& semantic) {
  if (semantic == "POSITION") return draco::GeometryAttribute::POSITION;
  if (semantic == "COLOR_0") return draco::GeometryAttribute::COLOR;
  return draco::GeometryAttribute::GENERIC;
}

draco::DataType type_of(Component component) {
  switch (component) {
    case Component::kUint8:
      return draco::DT_UINT8;
    case Component::kUint16:
      return draco::DT_UINT16;
    case Component::kFloat:
      return draco::DT_FLOAT32;
  }
  return draco::DT_INVALID;
}

/// Returns the id of the attribute in the compressed mesh.
int add_attribute(draco::Mesh& mesh, const VertexStream& stream, size_t vertices) {
  draco::GeometryAttribute attribute;
  attribute.Init(type_of(stream.semantic), nullptr, static_cast<uint8_t>(stream.width),
                 type_of(stream.component), stream.normalised, static_cast<int64_t>(stream.stride),
                 0);
  const int id = mesh.AddAttribute(attribute, true, static_cast<uint32_t>(vertices));
  mesh.attribute(id)->buffer()->Write(0, stream.bytes.data(), stream.bytes.size());
  return static_cast<int>(mesh.attribute(id)->unique_id());
}

std::unique_ptr<draco::Mesh> to_draco(const VertexStreams& mesh, std::vector<int>& ids) {
  auto out = std::make_unique<draco::Mesh>();
  out->set_num_points(static_cast<uint32_t>(mesh.vertices));
  for (size_t n = 0; n + 3 <= mesh.indices.size(); n += 3) {
    out->AddFace({draco::PointIndex(mesh.indices[n]), draco::PointIndex(mesh.indices[n + 1]),
                  draco::PointIndex(mesh.indices[n + 2])});
  }
  for (const VertexStream& stream : mesh.streams) {
    ids.push_back(add_attribute(*out, stream, mesh.vertices));
  }
  return out;
}

/// Quantises so that the positions of the grid are exact.
void set_quantisation(const PositionGrid& grid, draco::Encoder& encoder) {
  const Eigen::Vector3f origin = grid.origin.cast<float>();
  const int bits = std::max(1, static_cast<int>(std::bit_width(unsigned{grid.last})));
  const auto range = static_cast<float>(((1U << bits) - 1) * grid.step);
  encoder.SetAttributeExplicitQuantization(draco::GeometryAttribute::POSITION, bits, 3,
                                           origin.data(), range);
  const float black[] = {0, 0, 0};
  encoder.SetAttributeExplicitQuantization(draco::GeometryAttribute::COLOR, kLinearBits, 3, black,
                                           1);
}

/// Decodes the mesh: glTF requires counts and bounds of the decoded mesh.
void set_counts_and_bounds(DracoMesh& compressed) {
  draco::DecoderBuffer buffer;
  buffer.Init(reinterpret_cast<const char*>(compressed.bytes.data()), compressed.bytes.size());
  draco::Decoder decoder;
  auto decoded = decoder.DecodeMeshFromBuffer(&buffer);
  if (!decoded.ok()) throw std::runtime_error("Draco cannot read what it wrote");
  const draco::Mesh& mesh = *decoded.value();
  const auto* positions = mesh.GetNamedAttribute(draco::GeometryAttribute::POSITION);
  compressed.vertices = mesh.num_points();
  compressed.triangles = mesh.num_faces();
  compressed.low.setConstant(std::numeric_limits<float>::max());
  compressed.high = -compressed.low;
  for (uint32_t v = 0; v < mesh.num_points(); ++v) {
    Eigen::Vector3f at;
    positions->GetValue(positions->mapped_index(draco::PointIndex(v)), at.data());
    compressed.low = compressed.low.cwiseMin(at);
    compressed.high = compressed.high.cwiseMax(at);
  }
}

}  // namespace

DracoMesh compress_with_draco(const VertexStreams& mesh, const PositionGrid& grid) {
  DracoMesh compressed;
  const auto content = to_draco(mesh, compressed.ids);
  draco::Encoder encoder;
  encoder.SetSpeedOptions(0, 0);
  set_quantisation(grid, encoder);
  draco::EncoderBuffer buffer;
  const draco::Status status = encoder.EncodeMeshToBuffer(*content, &buffer);
  if (!status.ok()) {
    throw std::runtime_error(std::string("Draco cannot encode the mesh: ") + status.error_msg());
  }
  compressed.bytes.assign(buffer.data(), buffer.data() + buffer.size());
  set_counts_and_bounds(compressed);
  return compressed;
}

}  // namespace v3d::ctl
