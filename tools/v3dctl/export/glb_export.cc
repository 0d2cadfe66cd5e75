// glTF 2.0 binary: https://registry.khronos.org/glTF/specs/2.0/glTF-2.0.html, chapter 4.
#include <cmath>
#include <cstring>
#include <nlohmann/json.hpp>
#include <numbers>

#include "base/io/file.h"
#include "v3dctl/export/mesh_export.h"
#include "v3dctl/export/vertex_streams.h"

namespace v3d::ctl {
namespace {

using nlohmann::json;

constexpr int kArrayBuffer = 34962;
constexpr int kElementArrayBuffer = 34963;
constexpr int kUnsignedInt = 5125;
constexpr int kTriangles = 4;
constexpr const char* kDraco = "KHR_draco_mesh_compression";
constexpr const char* kMeshopt = "EXT_meshopt_compression";
constexpr const char* kQuantization = "KHR_mesh_quantization";
constexpr const char* kUnlit = "KHR_materials_unlit";

/// Linear light as integers up to `max`, three or four for each vertex.
template <class T>
std::vector<T> linear_colours(const Mesh& mesh, int width, double max) {
  std::vector<T> values;
  for (const Rgb8 c : mesh.colours) {
    for (const uint8_t channel : {c.r, c.g, c.b}) {
      values.push_back(static_cast<T>(std::round(max * linear_light(channel))));
    }
    if (width == 4) values.push_back(static_cast<T>(max));
  }
  return values;
}

VertexStream float_positions(const Mesh& mesh) {
  std::vector<float> values;
  for (const Eigen::Vector3f& v : mesh.vertices) values.insert(values.end(), v.begin(), v.end());
  return make_stream("POSITION", Component::kFloat, 3, values);
}

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
  std::vector<float> values = linear_colours<float>(mesh, 3, kMax);
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

VertexStreams streams_of(const Mesh& mesh, const MeshFileOptions& options,
                         const PositionGrid& grid) {
  VertexStreams out;
  out.vertices = mesh.vertices.size();
  out.streams.push_back(options.compression == Compression::kMeshopt ? integer_positions(grid)
                                                                     : float_positions(mesh));
  if (!mesh.colours.empty()) {
    out.streams.push_back(options.compression == Compression::kDraco
                              ? float_colours(mesh)
                              : make_stream("COLOR_0", Component::kUint16, 4,
                                            linear_colours<uint16_t>(mesh, 4, 65535)));
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
  Document() {
    gltf_["asset"] = {{"version", "2.0"}, {"generator", "v3dctl " V3D_VERSION}};
    gltf_["scene"] = 0;
    add_to("scenes", json::object());
  }

  void add(const Mesh& mesh, const MeshFileOptions& options) {
    PositionGrid grid;
    if (options.compression != Compression::kNone) {
      grid = quantise(mesh.vertices, options.lattice);
    }
    VertexStreams streams = streams_of(mesh, options, grid);
    add_node();
    switch (options.compression) {
      case Compression::kNone:
        add_plain(streams, mesh);
        break;
      case Compression::kDraco:
        add_draco(streams, grid);
        break;
      case Compression::kMeshopt:
        add_meshopt(streams, grid);
        break;
    }
    add_material();
    add_cameras(options.cameras);
  }

  /// The whole file.
  std::string bytes() {
    if (!binary_.empty()) gltf_["buffers"][0]["byteLength"] = binary_.size();
    std::string text = gltf_.dump();
    text.resize((text.size() + 3) / 4 * 4, ' ');
    binary_.resize((binary_.size() + 3) / 4 * 4, '\0');
    std::string body;
    put_chunk(body, 0x4E4F534A, text);  // "JSON"
    if (!binary_.empty()) put_chunk(body, 0x004E4942, binary_);
    std::string file = "glTF";
    put_word(file, 2);
    put_word(file, 12 + body.size());
    return file + body;
  }

 private:
  static void put_word(std::string& bytes, size_t word) {
    for (int shift = 0; shift < 32; shift += 8) bytes += static_cast<char>(word >> shift & 0xFF);
  }
  static void put_chunk(std::string& bytes, size_t type, const std::string& content) {
    put_word(bytes, content.size());
    put_word(bytes, type);
    bytes += content;
  }

  /// Returns the offset of the bytes, a multiple of 4.
  size_t append(std::span<const uint8_t> bytes) {
    binary_.resize((binary_.size() + 3) / 4 * 4, '\0');
    const size_t at = binary_.size();
    binary_.append(bytes.begin(), bytes.end());
    return at;
  }

  size_t add_to(const char* list, json item) {
    gltf_[list].push_back(std::move(item));
    return gltf_[list].size() - 1;
  }
  /// Its length is set later.
  json& add_buffer() {
    json buffer;
    buffer["byteLength"] = 0;
    return gltf_["buffers"][add_to("buffers", std::move(buffer))];
  }
  size_t add_view(std::span<const uint8_t> bytes) {
    return add_to("bufferViews",
                  {{"buffer", 0}, {"byteOffset", append(bytes)}, {"byteLength", bytes.size()}});
  }

  json& primitive() { return gltf_["meshes"][0]["primitives"][0]; }

  void require(const char* extension) {
    gltf_["extensionsUsed"].push_back(extension);
    gltf_["extensionsRequired"].push_back(extension);
  }

  /// z up to y up.
  void add_node() {
    const double half = std::numbers::sqrt2 / 2;
    add_to("nodes", {{"mesh", 0}, {"rotation", {-half, 0, 0, half}}});
    gltf_["scenes"][0]["nodes"].push_back(0);
    primitive()["mode"] = kTriangles;
  }

  static json accessor_of(const VertexStream& stream, size_t vertices) {
    json accessor = {{"componentType", static_cast<int>(stream.component)},
                     {"type", "VEC" + std::to_string(stream.width)},
                     {"count", vertices}};
    if (stream.normalised) accessor["normalized"] = true;
    return accessor;
  }
  static json accessor_of_indices(size_t count) {
    return {{"componentType", kUnsignedInt}, {"type", "SCALAR"}, {"count", count}};
  }
  void add_attribute(const std::string& semantic, json accessor) {
    primitive()["attributes"][semantic] = add_to("accessors", std::move(accessor));
  }
  void add_indices(json accessor) { primitive()["indices"] = add_to("accessors", accessor); }

  void add_plain(const VertexStreams& mesh, const Mesh& source) {
    add_buffer();
    for (const VertexStream& stream : mesh.streams) {
      json accessor = accessor_of(stream, mesh.vertices);
      const size_t view = add_view(stream.bytes);
      gltf_["bufferViews"][view]["target"] = kArrayBuffer;
      accessor["bufferView"] = view;
      if (stream.semantic == "POSITION") set_bounds(accessor, source.vertices);
      add_attribute(stream.semantic, std::move(accessor));
    }
    const auto* bytes = reinterpret_cast<const uint8_t*>(mesh.indices.data());
    const size_t view = add_view({bytes, mesh.indices.size() * sizeof(uint32_t)});
    gltf_["bufferViews"][view]["target"] = kElementArrayBuffer;
    json accessor = accessor_of_indices(mesh.indices.size());
    accessor["bufferView"] = view;
    add_indices(std::move(accessor));
  }

  static void set_bounds(json& accessor, const std::vector<Eigen::Vector3f>& vertices) {
    Eigen::Vector3f low = vertices.front(), high = low;
    for (const Eigen::Vector3f& vertex : vertices) {
      low = low.cwiseMin(vertex);
      high = high.cwiseMax(vertex);
    }
    accessor["min"] = floats(low);
    accessor["max"] = floats(high);
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
    const size_t view = add_view(compressed.bytes);
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
    json& node = gltf_["nodes"][0];
    node["scale"] = numbers(Eigen::Vector3d::Constant(grid.step));
    node["translation"] = {grid.origin.x(), grid.origin.z(), -grid.origin.y()};
  }

  size_t add_meshopt_view(std::span<const uint8_t> compressed, const char* mode, size_t count,
                          size_t stride, int target) {
    json& decoded = gltf_["buffers"][1]["byteLength"];
    const size_t at = decoded.get<size_t>();
    decoded = at + count * stride;
    json view = {
        {"buffer", 1}, {"byteOffset", at}, {"byteLength", count * stride}, {"target", target}};
    if (target == kArrayBuffer) view["byteStride"] = stride;
    view["extensions"][kMeshopt] = {{"buffer", 0},
                                    {"byteOffset", append(compressed)},
                                    {"byteLength", compressed.size()},
                                    {"byteStride", stride},
                                    {"mode", mode},
                                    {"count", count}};
    return add_to("bufferViews", std::move(view));
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

  /// Unlit: the colours contain the light of the studio.
  void add_material() {
    json material;
    material["name"] = "as seen";
    material["pbrMetallicRoughness"]["metallicFactor"] = 0;
    material["extensions"][kUnlit] = json::object();
    add_to("materials", std::move(material));
    gltf_["extensionsUsed"].push_back(kUnlit);
    primitive()["material"] = 0;
  }

  void add_cameras(std::span<const ExportedCamera> cameras) {
    for (const ExportedCamera& camera : cameras) {
      gltf_["meshes"][0]["extras"]["cameras"].push_back({{"name", camera.colours.camera},
                                                         {"attribute", semantic_of(camera)},
                                                         {"centre", numbers(camera.centre)},
                                                         {"axis", numbers(camera.axis)}});
    }
  }

  json gltf_;
  std::string binary_;
};

}  // namespace

void write_glb(const std::filesystem::path& path, const Mesh& mesh,
               const MeshFileOptions& options) {
  Document document;
  if (!mesh.triangles.empty()) document.add(mesh, options);
  replace_file(path, document.bytes());
}

}  // namespace v3d::ctl
