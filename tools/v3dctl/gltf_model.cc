// Reads glTF through tinygltf, which nothing else sees.
#include "v3dctl/gltf_model.h"

#include <tiny_gltf.h>

#include <algorithm>
#include <cmath>
#include <functional>

#include "base/error.h"

namespace v3d::ctl {
namespace {

namespace fs = std::filesystem;

constexpr int kTexelsPerCut = 3;
constexpr int kMostCuts = 128;  // of an edge
constexpr int kDeepestNode = 64;
constexpr size_t kMostTriangles = 4'000'000;

// The light of docs/scene.md.
const Eigen::Vector3f kSunDirection = Eigen::Vector3f(-0.4F, -0.6F, 1).normalized();
constexpr float kSun = 0.5F;
constexpr float kSky = 0.65F;
constexpr float kGround = 0.35F;

float linear_of(float srgb) {
  return srgb <= 0.04045F ? srgb / 12.92F : std::pow((srgb + 0.055F) / 1.055F, 2.4F);
}

uint8_t srgb_of(float linear) {
  const float s =
      linear <= 0.0031308F ? 12.92F * linear : 1.055F * std::pow(linear, 1 / 2.4F) - 0.055F;
  return static_cast<uint8_t>(std::lround(255 * std::clamp(s, 0.0F, 1.0F)));
}

/// What a triangle's corner has, before it is cut.
struct Corner {
  Eigen::Vector3f position, normal;
  Eigen::Vector3f colour = Eigen::Vector3f::Ones();
  Eigen::Vector2f uv = Eigen::Vector2f::Zero();
};

Corner mixed(const std::array<Corner, 3>& corners, float a, float b, float c) {
  return {a * corners[0].position + b * corners[1].position + c * corners[2].position,
          (a * corners[0].normal + b * corners[1].normal + c * corners[2].normal).normalized(),
          a * corners[0].colour + b * corners[1].colour + c * corners[2].colour,
          a * corners[0].uv + b * corners[1].uv + c * corners[2].uv};
}

/// A number of an accessor as a float; integers become 0 to 1.
float number_at(const unsigned char* at, int component) {
  const auto as = [&]<class T>(T) {
    T value;
    std::memcpy(&value, at, sizeof value);
    return value;
  };
  switch (component) {
    case TINYGLTF_COMPONENT_TYPE_FLOAT:
      return as(float{});
    case TINYGLTF_COMPONENT_TYPE_UNSIGNED_BYTE:
      return as(uint8_t{}) / 255.0F;
    case TINYGLTF_COMPONENT_TYPE_UNSIGNED_SHORT:
      return static_cast<float>(as(uint16_t{})) / 65535.0F;
    default:
      return 0;
  }
}

/// Reads one file; a bad index in it is an InputError, never a read beyond its bytes.
class Reader {
 public:
  explicit Reader(fs::path path) : path_(std::move(path)) {
    tinygltf::TinyGLTF loader;
    std::string error, warning;
    const bool binary = path_.extension() == ".glb";
    const bool loaded = binary
                            ? loader.LoadBinaryFromFile(&model_, &error, &warning, path_.string())
                            : loader.LoadASCIIFromFile(&model_, &error, &warning, path_.string());
    refuse_extensions();
    if (!loaded) refuse(error.empty() ? "is no glTF 2.0" : error.substr(0, error.find('\n')));
  }

  ModelSurface read() {
    if (model_.scenes.empty()) refuse("has no scene");
    const auto scene = static_cast<size_t>(std::max(0, model_.defaultScene));
    Eigen::Affine3f up = Eigen::Affine3f::Identity();
    up.linear() << 1, 0, 0, 0, 0, -1, 0, 1, 0;  // y up to z up
    for (const int node : of(model_.scenes, static_cast<int>(scene)).nodes) read_node(node, up, 0);
    if (surface_.mesh.triangles.empty()) refuse("has no triangles");
    return std::move(surface_);
  }

 private:
  [[noreturn]] void refuse(const std::string& what) const {
    throw InputError(path_.string() + ": " + what);
  }

  /// Whatever a file requires beyond materials may be its very triangles.
  void refuse_extensions() const {
    for (const std::string& name : model_.extensionsRequired) {
      if (name.starts_with("KHR_materials_")) continue;
      refuse("requires " + name + ", which is not read here: save it uncompressed, without " +
             name);
    }
  }

  template <class T>
  const T& of(const std::vector<T>& list, int index) const {
    if (index < 0 || static_cast<size_t>(index) >= list.size()) refuse("is a damaged glTF");
    return list[static_cast<size_t>(index)];
  }

  static Eigen::Affine3f transform_of(const tinygltf::Node& node) {
    Eigen::Affine3d transform = Eigen::Affine3d::Identity();
    if (node.matrix.size() == 16) {
      transform.matrix() = Eigen::Map<const Eigen::Matrix4d>(node.matrix.data());
      return transform.cast<float>();
    }
    if (node.translation.size() == 3) {
      transform.translate(Eigen::Map<const Eigen::Vector3d>(node.translation.data()));
    }
    if (node.rotation.size() == 4) {
      transform.rotate(
          Eigen::Quaterniond(node.rotation[3], node.rotation[0], node.rotation[1], node.rotation[2])
              .normalized());
    }
    if (node.scale.size() == 3) {
      transform.scale(Eigen::Vector3d(Eigen::Map<const Eigen::Vector3d>(node.scale.data())));
    }
    return transform.cast<float>();
  }

  void read_node(int index, const Eigen::Affine3f& parent, int depth) {
    if (depth > kDeepestNode) refuse("has nodes within nodes without end");
    const tinygltf::Node& node = of(model_.nodes, index);
    const Eigen::Affine3f transform = parent * transform_of(node);
    if (node.mesh >= 0) {
      for (const auto& primitive : of(model_.meshes, node.mesh).primitives) {
        if (primitive.mode == TINYGLTF_MODE_TRIANGLES) read_primitive(primitive, transform);
      }
    }
    for (const int child : node.children) read_node(child, transform, depth + 1);
  }

  /// Where an accessor's element lies. Requires element < count.
  const unsigned char* element(const tinygltf::Accessor& accessor, size_t n, size_t bytes) const {
    const tinygltf::BufferView& view = of(model_.bufferViews, accessor.bufferView);
    const auto& data = of(model_.buffers, view.buffer).data;
    const int stride = accessor.ByteStride(view);
    const size_t at = view.byteOffset + accessor.byteOffset + n * static_cast<size_t>(stride);
    if (stride <= 0 || at > data.size() || bytes > data.size() - at) refuse("is a damaged glTF");
    return data.data() + at;
  }

  /// Rows of `width` numbers; empty where the primitive has no such attribute.
  std::vector<Eigen::Vector3f> attribute(const tinygltf::Primitive& primitive,
                                         const std::string& name, int width) const {
    const auto found = primitive.attributes.find(name);
    if (found == primitive.attributes.end()) return {};
    const tinygltf::Accessor& accessor = of(model_.accessors, found->second);
    const int size =
        tinygltf::GetComponentSizeInBytes(static_cast<uint32_t>(accessor.componentType));
    if (size <= 0 ||
        tinygltf::GetNumComponentsInType(static_cast<uint32_t>(accessor.type)) < width) {
      refuse("is a damaged glTF");
    }
    std::vector<Eigen::Vector3f> values;
    for (size_t n = 0; n < accessor.count; ++n) {
      const auto* at = element(accessor, n, static_cast<size_t>(size) * static_cast<size_t>(width));
      Eigen::Vector3f value = Eigen::Vector3f::Zero();
      for (int k = 0; k < width; ++k) value[k] = number_at(at + k * size, accessor.componentType);
      values.push_back(value);
    }
    return values;
  }

  std::vector<uint32_t> indices(const tinygltf::Primitive& primitive, size_t vertices) const {
    std::vector<uint32_t> list;
    if (primitive.indices < 0) {
      for (uint32_t v = 0; v < vertices; ++v) list.push_back(v);
      return list;
    }
    const tinygltf::Accessor& accessor = of(model_.accessors, primitive.indices);
    const int size =
        tinygltf::GetComponentSizeInBytes(static_cast<uint32_t>(accessor.componentType));
    for (size_t n = 0; n < accessor.count && size > 0; ++n) {
      uint32_t index = 0;  // little-endian, as glTF and we are
      std::memcpy(&index, element(accessor, n, static_cast<size_t>(size)),
                  std::min<size_t>(sizeof index, static_cast<size_t>(size)));
      if (index >= vertices) refuse("is a damaged glTF");
      list.push_back(index);
    }
    return list;
  }

  const tinygltf::Image* texture_of(const tinygltf::Material& material) const {
    const int index = material.pbrMetallicRoughness.baseColorTexture.index;
    if (index < 0) return nullptr;
    const tinygltf::Image& image = of(model_.images, of(model_.textures, index).source);
    const bool known = image.width > 0 && image.height > 0 && image.bits == 8 &&
                       image.image.size() >= static_cast<size_t>(image.width) * image.height *
                                                 static_cast<size_t>(image.component) &&
                       image.component >= 3;
    return known ? &image : nullptr;
  }

  void read_primitive(const tinygltf::Primitive& primitive, const Eigen::Affine3f& transform) {
    const auto positions = attribute(primitive, "POSITION", 3);
    auto normals = attribute(primitive, "NORMAL", 3);
    const auto colours = attribute(primitive, "COLOR_0", 3);
    const auto uvs = attribute(primitive, "TEXCOORD_0", 2);
    const auto list = indices(primitive, positions.size());
    const Eigen::Matrix3f turn = transform.linear().inverse().transpose();
    const bool mirrored = transform.linear().determinant() < 0;
    begin_material(primitive);
    for (size_t n = 0; n + 3 <= list.size(); n += 3) {
      std::array<Corner, 3> corners;
      for (size_t k = 0; k < 3; ++k) {
        const uint32_t v = list[n + (mirrored && k > 0 ? 3 - k : k)];
        corners[k].position = transform * positions[v];
        corners[k].normal = v < normals.size() ? (turn * normals[v]).normalized().eval()
                                               : Eigen::Vector3f::Zero().eval();
        if (v < colours.size()) corners[k].colour = colours[v];
        if (v < uvs.size()) corners[k].uv = uvs[v].head<2>();
      }
      give_normals(corners);
      add(corners);
    }
  }

  static void give_normals(std::array<Corner, 3>& corners) {
    if (corners[0].normal.norm() > 0.5F) return;
    const Eigen::Vector3f normal = (corners[1].position - corners[0].position)
                                       .cross(corners[2].position - corners[0].position)
                                       .normalized();
    for (Corner& corner : corners) corner.normal = normal;
  }

  void begin_material(const tinygltf::Primitive& primitive) {
    factor_ = Eigen::Vector3f::Ones();
    texture_ = nullptr;
    unlit_ = false;
    if (primitive.material < 0) return;
    const tinygltf::Material& material = of(model_.materials, primitive.material);
    const auto& factor = material.pbrMetallicRoughness.baseColorFactor;
    for (size_t k = 0; k < 3 && k < factor.size(); ++k) {
      factor_[static_cast<int>(k)] = static_cast<float>(factor[k]);
    }
    texture_ = texture_of(material);
    unlit_ = material.extensions.contains("KHR_materials_unlit");
  }

  int cuts_of(const std::array<Corner, 3>& corners) const {
    if (texture_ == nullptr) return 1;
    const Eigen::Array2f texels(static_cast<float>(texture_->width),
                                static_cast<float>(texture_->height));
    float longest = 0;
    for (size_t k = 0; k < 3; ++k) {
      const Eigen::Array2f edge = (corners[(k + 1) % 3].uv - corners[k].uv).array() * texels;
      longest = std::max(longest, edge.matrix().norm());
    }
    return std::clamp(static_cast<int>(std::ceil(longest / kTexelsPerCut)), 1, kMostCuts);
  }

  /// Cut into cuts * cuts triangles.
  void add(const std::array<Corner, 3>& corners) {
    const int cuts = cuts_of(corners);
    Mesh& mesh = surface_.mesh;
    if (mesh.triangles.size() + static_cast<size_t>(cuts) * cuts > kMostTriangles) {
      refuse("is too large: more than 4 million triangles with its textures");
    }
    const auto first = static_cast<uint32_t>(mesh.vertices.size());
    for (int i = 0; i <= cuts; ++i) {
      for (int j = 0; j <= i; ++j) {
        const auto whole = static_cast<float>(cuts);
        add_vertex(mixed(corners, static_cast<float>(cuts - i) / whole,
                         static_cast<float>(i - j) / whole, static_cast<float>(j) / whole));
      }
    }
    const auto at = [&](int i, int j) {
      return first + static_cast<uint32_t>(i * (i + 1) / 2 + j);
    };
    for (int i = 0; i < cuts; ++i) {
      for (int j = 0; j <= i; ++j) {
        mesh.triangles.push_back({at(i, j), at(i + 1, j), at(i + 1, j + 1)});
        if (j < i) mesh.triangles.push_back({at(i, j), at(i + 1, j + 1), at(i, j + 1)});
      }
    }
  }

  void add_vertex(const Corner& corner) {
    surface_.mesh.vertices.push_back(corner.position);
    surface_.normals.push_back(corner.normal);
    Eigen::Vector3f albedo = factor_.cwiseProduct(corner.colour);
    if (texture_ != nullptr) albedo = albedo.cwiseProduct(texel(corner.uv));
    surface_.albedo.push_back(albedo);
    surface_.unlit.push_back(unlit_ ? 1 : 0);
  }

  /// Linear light, bilinear between texels; the texture is repeated.
  Eigen::Vector3f texel(const Eigen::Vector2f& uv) const {
    const float x = uv.x() * static_cast<float>(texture_->width) - 0.5F;
    const float y = uv.y() * static_cast<float>(texture_->height) - 0.5F;
    const auto i = static_cast<int64_t>(std::floor(x)), j = static_cast<int64_t>(std::floor(y));
    const float s = x - static_cast<float>(i), t = y - static_cast<float>(j);
    return (1 - t) * ((1 - s) * one_texel(i, j) + s * one_texel(i + 1, j)) +
           t * ((1 - s) * one_texel(i, j + 1) + s * one_texel(i + 1, j + 1));
  }
  Eigen::Vector3f one_texel(int64_t x, int64_t y) const {
    const auto within = [](int64_t n, int size) {
      return static_cast<size_t>(((n % size) + size) % size);
    };
    const size_t at = (within(y, texture_->height) * static_cast<size_t>(texture_->width) +
                       within(x, texture_->width)) *
                      static_cast<size_t>(texture_->component);
    return {linear_of(texture_->image[at] / 255.0F), linear_of(texture_->image[at + 1] / 255.0F),
            linear_of(texture_->image[at + 2] / 255.0F)};
  }

  fs::path path_;
  tinygltf::Model model_;
  ModelSurface surface_;
  Eigen::Vector3f factor_ = Eigen::Vector3f::Ones();
  const tinygltf::Image* texture_ = nullptr;
  bool unlit_ = false;
};

}  // namespace

ModelSurface load_model(const fs::path& path) { return Reader(path).read(); }

Mesh lit_model(const ModelSurface& model, const Eigen::Affine3d& world_from_model) {
  Mesh mesh;
  mesh.triangles = model.mesh.triangles;
  const Eigen::Affine3f place = world_from_model.cast<float>();
  for (size_t v = 0; v < model.mesh.vertices.size(); ++v) {
    mesh.vertices.push_back(place * model.mesh.vertices[v]);
    const Eigen::Vector3f normal = (place.linear() * model.normals[v]).normalized();
    const float sky = 0.5F + 0.5F * normal.z();
    const float light =
        kGround + (kSky - kGround) * sky + kSun * std::max(0.0F, normal.dot(kSunDirection));
    const Eigen::Vector3f seen = (model.unlit[v] != 0 ? 1 : light) * model.albedo[v];
    mesh.colours.push_back({srgb_of(seen.x()), srgb_of(seen.y()), srgb_of(seen.z())});
  }
  return mesh;
}

}  // namespace v3d::ctl
