// glTF 2.0 binary: https://registry.khronos.org/glTF/specs/2.0/glTF-2.0.html, chapter 4.
#include <algorithm>
#include <array>
#include <cstdint>
#include <cstring>
#include <nlohmann/json.hpp>
#include <optional>
#include <vector>

#include "base/image/image_files.h"
#include "base/io/file.h"
#include "recon/texture/texture_atlas.h"
#include "v3dctl/export/gltf_document.h"
#include "v3dctl/export/mesh_export.h"
#include "v3dctl/export/vertex_streams.h"

namespace v3d::ctl {
namespace {

using nlohmann::json;

constexpr const char* kDraco = "KHR_draco_mesh_compression";
constexpr const char* kMeshopt = "EXT_meshopt_compression";
constexpr const char* kQuantization = "KHR_mesh_quantization";

VertexStream integer_positions(const PositionGrid& grid) {
  std::vector<uint16_t> values;
  for (const auto& position : grid.positions)
    values.insert(values.end(), position.begin(), position.end());
  VertexStream stream = make_stream("POSITION", Component::kUint16, 3, values);
  stream.normalised = false;
  return stream;
}

/// Draco requires floats; it keeps kLinearBits of them.
VertexStream float_colours(const Mesh& mesh) {
  constexpr double kMax = (1 << kLinearBits) - 1;
  std::vector<float> values = linear_light<float>(mesh, 3, kMax);
  for (float& value : values) value /= static_cast<float>(kMax);
  return make_stream("COLOR_0", Component::kFloat, 3, values);
}

/// "_CAM01_COLOR"
std::string semantic_of(const ExportedCamera& camera) {
  std::string semantic = "_" + attribute_name(camera.colours.camera) + "_COLOR";
  for (char& c : semantic) {
    if (c >= 'a' && c <= 'z') c = static_cast<char>(c - 'a' + 'A');
  }
  return semantic;
}

VertexStream seen_colours(const ExportedCamera& camera) {
  std::vector<uint8_t> values;
  for (const auto& rgba : camera.colours.vertices) {
    values.insert(values.end(), rgba.begin(), rgba.end());
  }
  return make_stream(semantic_of(camera), Component::kUint8, 4, values);
}

/// TEXCOORD_0 and, where asked for, _VERTEX.
void add_texture_streams(const TexturedMesh& textured, const MeshFileOptions& options,
                         VertexStreams& out) {
  out.streams.push_back(texture_coordinates(textured));
  if (!options.number_vertices) return;
  // glTF has no attributes of 32 bit integers; floats are exact up to 2^24.
  const std::vector<float> numbers(textured.source.begin(), textured.source.end());
  out.streams.push_back(make_stream("_VERTEX", Component::kFloat, 1, numbers));
}

VertexStreams streams_of(const Mesh& mesh, const MeshFileOptions& options, const PositionGrid& grid,
                         const TexturedMesh* textured) {
  VertexStreams out;
  out.vertices = mesh.vertices.size();
  out.streams.push_back(options.compression == Compression::kMeshopt ? integer_positions(grid)
                                                                     : float_positions(mesh));
  if (textured != nullptr) add_texture_streams(*textured, options, out);
  if (!mesh.colours.empty()) {
    out.streams.push_back(options.compression == Compression::kDraco ? float_colours(mesh)
                                                                     : linear_colours(mesh));
  }
  for (const ExportedCamera& camera : options.cameras) {
    out.streams.push_back(seen_colours(camera));
  }
  for (const auto& triangle : mesh.triangles) {
    out.indices.insert(out.indices.end(), triangle.begin(), triangle.end());
  }
  return out;
}

json floats(const Eigen::Vector3f& v) { return {v.x(), v.y(), v.z()}; }
json numbers(const Eigen::Vector3d& v) { return {v.x(), v.y(), v.z()}; }

/// JSON and binary chunk of a file with one mesh.
class Document {
 public:
  void add(const Mesh& original, const MeshFileOptions& options) {
    std::optional<TexturedMesh> textured;
    if (options.atlas != nullptr) textured = with_coordinates(original, options.atlas->layout);
    const Mesh& mesh = textured ? textured->mesh : original;
    PositionGrid grid;
    if (options.compression != Compression::kNone) {
      grid = quantise(mesh.vertices, options.lattice);
    }
    VertexStreams streams = streams_of(mesh, options, grid, textured ? &*textured : nullptr);
    add_node();
    if (options.timecode) {
      gltf()["nodes"][0]["extras"] = timecode_extras(options.pulse, *options.timecode);
    }
    switch (options.compression) {
      case Compression::kNone:
        add_plain(streams);
        break;
      case Compression::kDraco:
        add_draco(streams, grid);
        break;
      case Compression::kMeshopt:
        add_meshopt(streams, grid);
        break;
    }
    add_material(options);
    add_cameras(options.cameras);
  }

  std::string bytes() { return out_.bytes(); }

 private:
  json& gltf() { return out_.gltf(); }
  /// Its length is set later.
  json& add_buffer() { return gltf()["buffers"][out_.add_buffer()]; }

  json& primitive() { return gltf()["meshes"][0]["primitives"][0]; }

  void require(const char* extension) {
    gltf()["extensionsUsed"].push_back(extension);
    gltf()["extensionsRequired"].push_back(extension);
  }

  /// z up to y up.
  void add_node() {
    out_.add("nodes", {{"mesh", 0}, {"rotation", y_up_rotation()}});
    gltf()["scenes"][0]["nodes"].push_back(0);
    primitive()["mode"] = kTriangles;
  }

  void add_attribute(const std::string& semantic, json accessor) {
    primitive()["attributes"][semantic] = out_.add("accessors", std::move(accessor));
  }
  void add_indices(json accessor) { primitive()["indices"] = out_.add("accessors", accessor); }

  void add_plain(const VertexStreams& mesh) {
    add_buffer();
    for (const VertexStream& stream : mesh.streams) {
      primitive()["attributes"][stream.semantic] = out_.add_attribute(stream, mesh.vertices);
    }
    primitive()["indices"] = out_.add_indices(mesh.indices);
  }

  void add_draco(const VertexStreams& mesh, const PositionGrid& grid) {
    add_buffer();
    require(kDraco);
    const DracoMesh compressed = compress_with_draco(mesh, grid);
    json ids;
    for (size_t n = 0; n < mesh.streams.size(); ++n) {
      const VertexStream& stream = mesh.streams[n];
      ids[stream.semantic] = compressed.ids[n];
      json accessor = accessor_of(stream, compressed.vertices);
      if (stream.semantic == "POSITION") {
        accessor["min"] = floats(compressed.low);
        accessor["max"] = floats(compressed.high);
      }
      add_attribute(stream.semantic, std::move(accessor));
    }
    add_indices(accessor_of_indices(3 * compressed.triangles));
    const size_t view = out_.add_view(compressed.bytes);
    primitive()["extensions"][kDraco] = {{"bufferView", view}, {"attributes", ids}};
  }

  /// The compressed bytes are in the file. The buffer views refer to a second buffer without bytes,
  /// which readers fill with the decoded ones.
  void add_meshopt(VertexStreams& mesh, const PositionGrid& grid) {
    add_buffer();
    add_buffer()["extensions"][kMeshopt]["fallback"] = true;
    require(kMeshopt);
    require(kQuantization);
    order_for_meshopt(mesh);
    for (const VertexStream& stream : mesh.streams) {
      json accessor = accessor_of(stream, mesh.vertices);
      accessor["bufferView"] =
          add_meshopt_view(compress_vertices(stream, mesh.vertices), "ATTRIBUTES", mesh.vertices,
                           stream.stride, kArrayBuffer);
      if (stream.semantic == "POSITION") set_bounds(accessor, stream);
      add_attribute(stream.semantic, std::move(accessor));
    }
    json accessor = accessor_of_indices(mesh.indices.size());
    accessor["bufferView"] =
        add_meshopt_view(compress_triangles(mesh.indices, mesh.vertices), "TRIANGLES",
                         mesh.indices.size(), sizeof(uint32_t), kElementArrayBuffer);
    add_indices(std::move(accessor));
    // Grid to metres, rotated as the node is: (x, y, z) to (x, z, -y).
    json& node = gltf()["nodes"][0];
    node["scale"] = numbers(Eigen::Vector3d::Constant(grid.step));
    node["translation"] = {grid.origin.x(), grid.origin.z(), -grid.origin.y()};
  }

  size_t add_meshopt_view(std::span<const uint8_t> compressed, const char* mode, size_t count,
                          size_t stride, int target) {
    json& decoded = gltf()["buffers"][1]["byteLength"];
    const size_t at = decoded.get<size_t>();
    decoded = at + count * stride;
    json view = {
        {"buffer", 1}, {"byteOffset", at}, {"byteLength", count * stride}, {"target", target}};
    if (target == kArrayBuffer) view["byteStride"] = stride;
    view["extensions"][kMeshopt] = {{"buffer", 0},
                                    {"byteOffset", out_.append(compressed)},
                                    {"byteLength", compressed.size()},
                                    {"byteStride", stride},
                                    {"mode", mode},
                                    {"count", count}};
    return out_.add("bufferViews", std::move(view));
  }

  static void set_bounds(json& accessor, const VertexStream& positions) {
    std::array<uint16_t, 3> low{65535, 65535, 65535}, high{0, 0, 0};
    for (size_t at = 0; at < positions.bytes.size(); at += positions.stride) {
      std::array<uint16_t, 3> position;
      std::memcpy(position.data(), positions.bytes.data() + at, sizeof position);
      for (size_t axis = 0; axis < 3; ++axis) {
        low[axis] = std::min(low[axis], position[axis]);
        high[axis] = std::max(high[axis], position[axis]);
      }
    }
    accessor["min"] = low;
    accessor["max"] = high;
  }

  void add_material(const MeshFileOptions& options) {
    const size_t material = out_.add_unlit_material();
    primitive()["material"] = material;
    if (options.atlas == nullptr) return;
    out_.set_texture(material, encode_jpeg(options.atlas->image.view(), options.atlas_quality));
  }

  void add_cameras(std::span<const ExportedCamera> cameras) {
    for (const ExportedCamera& camera : cameras) {
      gltf()["meshes"][0]["extras"]["cameras"].push_back({{"name", camera.colours.camera},
                                                          {"attribute", semantic_of(camera)},
                                                          {"centre", numbers(camera.centre)},
                                                          {"axis", numbers(camera.axis)}});
    }
  }

  GltfDocument out_;
};

}  // namespace

void write_glb(const std::filesystem::path& path, const Mesh& mesh,
               const MeshFileOptions& options) {
  Document document;
  if (!mesh.triangles.empty()) document.add(mesh, options);
  replace_file(path, document.bytes());
}

}  // namespace v3d::ctl
