// glTF 2.0 binary through tinygltf, which only gltf_model.cc sees beside it.
#include <tiny_gltf.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <numbers>
#include <stdexcept>

#include "v3dctl/mesh_export.h"

namespace v3d::ctl {
namespace {

// glTF's vertex colours are linear light; 16 bits keep what 8 bits of sRGB tell apart.
uint16_t linear16(uint8_t srgb) {
  const double s = srgb / 255.0;
  const double linear = s <= 0.04045 ? s / 12.92 : std::pow((s + 0.055) / 1.055, 2.4);
  return static_cast<uint16_t>(std::lround(65535 * linear));
}

std::vector<uint16_t> linear_rgba(const Mesh& mesh) {
  std::vector<uint16_t> rgba;
  rgba.reserve(4 * mesh.colours.size());
  for (const Rgb8 c : mesh.colours) {
    rgba.insert(rgba.end(), {linear16(c.r), linear16(c.g), linear16(c.b), 65535});
  }
  return rgba;
}

// Appends `bytes` to the only buffer, on a multiple of 4, and describes them; returns the view.
int add_view(tinygltf::Model& model, const void* data, size_t bytes, int target) {
  std::vector<unsigned char>& buffer = model.buffers.front().data;
  buffer.resize((buffer.size() + 3) / 4 * 4);
  tinygltf::BufferView view;
  view.buffer = 0;
  view.byteOffset = buffer.size();
  view.byteLength = bytes;
  view.target = target;
  const auto* begin = static_cast<const unsigned char*>(data);
  buffer.insert(buffer.end(), begin, begin + bytes);
  model.bufferViews.push_back(view);
  return static_cast<int>(model.bufferViews.size()) - 1;
}

int add_accessor(tinygltf::Model& model, int view, int component, int type, size_t count) {
  tinygltf::Accessor accessor;
  accessor.bufferView = view;
  accessor.componentType = component;
  accessor.type = type;
  accessor.count = count;
  accessor.normalized = component == TINYGLTF_COMPONENT_TYPE_UNSIGNED_SHORT;
  model.accessors.push_back(accessor);
  return static_cast<int>(model.accessors.size()) - 1;
}

int add_positions(tinygltf::Model& model, const std::vector<Eigen::Vector3f>& vertices) {
  const int view = add_view(model, vertices.data(), vertices.size() * sizeof(Eigen::Vector3f),
                            TINYGLTF_TARGET_ARRAY_BUFFER);
  const int index =
      add_accessor(model, view, TINYGLTF_COMPONENT_TYPE_FLOAT, TINYGLTF_TYPE_VEC3, vertices.size());
  Eigen::Vector3f low = vertices.front();
  Eigen::Vector3f high = low;
  for (const Eigen::Vector3f& vertex : vertices) {
    low = low.cwiseMin(vertex);
    high = high.cwiseMax(vertex);
  }
  tinygltf::Accessor& accessor = model.accessors[static_cast<size_t>(index)];
  accessor.minValues = {low.x(), low.y(), low.z()};
  accessor.maxValues = {high.x(), high.y(), high.z()};
  return index;
}

int add_unlit_material(tinygltf::Model& model) {
  tinygltf::Material material;
  material.name = "as seen";  // the light of the studio is in the colours already
  material.extensions["KHR_materials_unlit"] = tinygltf::Value(tinygltf::Value::Object());
  material.pbrMetallicRoughness.metallicFactor = 0;
  model.extensionsUsed.push_back("KHR_materials_unlit");
  model.materials.push_back(material);
  return 0;
}

int add_mesh(tinygltf::Model& model, const Mesh& mesh) {
  model.buffers.emplace_back();
  tinygltf::Primitive primitive;
  primitive.mode = TINYGLTF_MODE_TRIANGLES;
  primitive.material = add_unlit_material(model);
  primitive.attributes["POSITION"] = add_positions(model, mesh.vertices);
  if (!mesh.colours.empty()) {
    const std::vector<uint16_t> rgba = linear_rgba(mesh);
    const int view =
        add_view(model, rgba.data(), rgba.size() * sizeof(uint16_t), TINYGLTF_TARGET_ARRAY_BUFFER);
    primitive.attributes["COLOR_0"] =
        add_accessor(model, view, TINYGLTF_COMPONENT_TYPE_UNSIGNED_SHORT, TINYGLTF_TYPE_VEC4,
                     mesh.colours.size());
  }
  const int view = add_view(model, mesh.triangles.data(), mesh.triangles.size() * 12,
                            TINYGLTF_TARGET_ELEMENT_ARRAY_BUFFER);
  primitive.indices = add_accessor(model, view, TINYGLTF_COMPONENT_TYPE_UNSIGNED_INT,
                                   TINYGLTF_TYPE_SCALAR, 3 * mesh.triangles.size());
  tinygltf::Mesh node_mesh;
  node_mesh.primitives.push_back(primitive);
  model.meshes.push_back(node_mesh);
  return 0;
}

}  // namespace

void write_glb(const std::filesystem::path& path, const Mesh& mesh) {
  tinygltf::Model model;
  model.asset.version = "2.0";
  model.asset.generator = "v3dctl " V3D_VERSION;
  tinygltf::Scene scene;
  if (!mesh.triangles.empty()) {
    tinygltf::Node node;
    node.mesh = add_mesh(model, mesh);
    node.rotation = {-std::numbers::sqrt2 / 2, 0, 0, std::numbers::sqrt2 / 2};  // z up to y up
    model.nodes.push_back(node);
    scene.nodes.push_back(0);
  }
  model.scenes.push_back(scene);
  model.defaultScene = 0;
  tinygltf::TinyGLTF writer;
  if (!writer.WriteGltfSceneToFile(&model, path.string(), true, true, false, true)) {
    throw std::runtime_error(path.string() + ": cannot write");
  }
}

}  // namespace v3d::ctl
