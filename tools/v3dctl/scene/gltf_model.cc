// Only this file includes tinygltf.
#include <tiny_gltf.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <map>

#include "base/core/error.h"
#include "base/image/image_files.h"
#include "base/io/file.h"
#include "v3dctl/scene/model.h"

namespace v3d::ctl {
namespace {

namespace fs = std::filesystem;

/// Limit of rows of attributes, counted again for every node that shows a mesh. Three attributes of
/// every corner of the triangles above, and indices.
constexpr size_t kMaxVertices = 12 * kMaxModelTriangles;
constexpr uint64_t kMaxBytes = 512 << 20;
/// Limit of the pixels of all used textures together: one texture of the largest size.
constexpr int64_t kMaxTexels = int64_t{kMaxImageSide} * kMaxImageSide;
/// Limit of an attribute. Products of a few such numbers are finite in float.
constexpr float kMaxValue = 1e9F;
constexpr float kMaxMetres = 1e6F;

/// Component of an accessor as a float; integers are normalised to 0 to 1.
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

/// Transforms normals: the inverse transpose of `m` times a positive factor (its cofactors). Finite
/// also where `m` is singular.
Eigen::Matrix3f normal_transform(const Eigen::Matrix3f& m) {
  Eigen::Matrix3f cofactors;
  cofactors << m.col(1).cross(m.col(2)), m.col(2).cross(m.col(0)), m.col(0).cross(m.col(1));
  return m.determinant() < 0 ? (-cofactors).eval() : cofactors;
}

// --- callbacks of tinygltf

/// Hides files outside of the model's folder: tinygltf also searches the working directory.
bool is_in_folder(const std::string& path, void* folder) {
  return lies_within(path, *static_cast<const fs::path*>(folder));
}

std::string same_path(const std::string& path, void*) { return path; }

bool read_beside(std::vector<unsigned char>* bytes, std::string* error, const std::string& path,
                 void*) {
  const auto text = io::read_file(path, kMaxBytes);
  if (!text) {
    *error = text.error().message;
    return false;
  }
  bytes->assign(text->begin(), text->end());
  return true;
}

/// Keeps an image encoded; texture_of() decodes it if a triangle uses it.
bool keep_bytes(tinygltf::Image* image, int, std::string*, std::string*, int, int,
                const unsigned char* bytes, int size, void*) {
  image->image.assign(bytes, bytes + size);
  return true;
}

/// Reads one file. A bad index in it is an InputError and never a read out of bounds.
class Reader {
 public:
  Reader(std::string_view bytes, fs::path path) : path_(std::move(path)) {
    check_gltf(json_of(bytes), path_);
    try {
      load(bytes);
    } catch (const InputError&) {
      throw;
    } catch (const std::exception&) {  // of tinygltf and its JSON parser
      refuse("is a damaged glTF");
    }
  }

  ModelSurface read() {
    if (model_.scenes.empty()) refuse("has no scene");
    const auto scene = static_cast<size_t>(std::max(0, model_.defaultScene));
    Eigen::Affine3f up = Eigen::Affine3f::Identity();
    up.linear() << 1, 0, 0, 0, 0, -1, 0, 1, 0;  // y up to z up
    for (const int node : of(model_.scenes, static_cast<int>(scene)).nodes) read_node(node, up);
    if (builder_.surface().mesh.triangles.empty()) refuse("has no triangles");
    return builder_.take();
  }

 private:
  [[noreturn]] void refuse(const std::string& what) const {
    throw InputError(path_.string() + ": " + what);
  }

  static bool is_binary(std::string_view bytes) { return bytes.starts_with("glTF"); }

  /// First chunk of a binary file; otherwise the whole file.
  std::string_view json_of(std::string_view bytes) const {
    constexpr size_t kHead = 20;
    if (!is_binary(bytes)) return bytes;
    uint32_t length = 0;
    if (bytes.size() >= kHead) std::memcpy(&length, bytes.data() + 12, sizeof length);
    if (bytes.size() < kHead || length > bytes.size() - kHead) refuse("is no glTF 2.0: truncated");
    return bytes.substr(kHead, length);
  }

  void load(std::string_view bytes) {
    std::error_code none;
    fs::path folder = fs::canonical(path_.has_parent_path() ? path_.parent_path() : ".", none);
    tinygltf::TinyGLTF loader;
    loader.SetFsCallbacks({is_in_folder, same_path, read_beside, nullptr, &folder});
    loader.SetImageLoader(keep_bytes, nullptr);
    std::string error, warning;
    const auto size = static_cast<unsigned int>(bytes.size());
    const auto* const first = reinterpret_cast<const unsigned char*>(bytes.data());
    const bool loaded =
        is_binary(bytes)
            ? loader.LoadBinaryFromMemory(&model_, &error, &warning, first, size, folder)
            : loader.LoadASCIIFromString(&model_, &error, &warning, bytes.data(), size, folder);
    if (!loaded) refuse(error.empty() ? "is no glTF 2.0" : error.substr(0, error.find('\n')));
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

  /// Recursive; check_gltf() limits the depth of nodes.
  void read_node(int index, const Eigen::Affine3f& parent) {
    const tinygltf::Node& node = of(model_.nodes, index);
    const Eigen::Affine3f transform = parent * transform_of(node);
    if (node.mesh >= 0) {
      for (const auto& primitive : of(model_.meshes, node.mesh).primitives) {
        if (primitive.mode != TINYGLTF_MODE_TRIANGLES) continue;
        read_primitive(primitive, transform, index);
      }
    }
    for (const int child : node.children) read_node(child, transform);
  }

  /// Bytes of element `n` of an accessor. Requires n < count.
  const unsigned char* element(const tinygltf::Accessor& accessor, size_t n, size_t bytes) const {
    const tinygltf::BufferView& view = of(model_.bufferViews, accessor.bufferView);
    const auto& data = of(model_.buffers, view.buffer).data;
    const int stride = accessor.ByteStride(view);
    const size_t at = view.byteOffset + accessor.byteOffset + n * static_cast<size_t>(stride);
    if (stride <= 0 || at > data.size() || bytes > data.size() - at) refuse("is a damaged glTF");
    return data.data() + at;
  }

  /// Rows of `width` numbers of an attribute; empty if the primitive has none.
  std::vector<Eigen::Vector3f> attribute(const tinygltf::Primitive& primitive,
                                         const std::string& name, int width) {
    const auto found = primitive.attributes.find(name);
    if (found == primitive.attributes.end()) return {};
    const tinygltf::Accessor& accessor = of(model_.accessors, found->second);
    if (accessor.sparse.isSparse) refuse(name + " is sparse, which is not read here");
    if (accessor.count > kMaxVertices - vertices_read_) {
      refuse(
          "is too large: more than 48 million rows of attributes, counted for every node that "
          "shows them");
    }
    vertices_read_ += accessor.count;
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
      if (!(value.cwiseAbs().maxCoeff<Eigen::PropagateNaN>() <= kMaxValue)) {
        refuse(name + ": vertex " + std::to_string(n) +
               " is not finite, or beyond a thousand million; expected finite numbers");
      }
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
      uint32_t index = 0;  // little-endian, as glTF and this machine
      std::memcpy(&index, element(accessor, n, static_cast<size_t>(size)),
                  std::min<size_t>(sizeof index, static_cast<size_t>(size)));
      if (index >= vertices) refuse("is a damaged glTF");
      list.push_back(index);
    }
    return list;
  }

  /// Texture of a material, decoded once; null without a texture.
  const Image* texture_of(const tinygltf::Material& material) {
    const int index = material.pbrMetallicRoughness.baseColorTexture.index;
    if (index < 0) return nullptr;
    const int source = of(model_.textures, index).source;
    if (const auto known = textures_.find(source); known != textures_.end()) return &known->second;
    const std::vector<unsigned char>& bytes = of(model_.images, source).image;
    const std::string_view text(reinterpret_cast<const char*>(bytes.data()), bytes.size());
    Image picture =
        decode_picture(text, path_.string() + ": images[" + std::to_string(source) + "]");
    texels_ += picture.size.pixels();
    if (texels_ > kMaxTexels) refuse("has textures of more than 268 million pixels together");
    return &textures_.emplace(source, std::move(picture)).first->second;
  }

  void read_primitive(const tinygltf::Primitive& primitive, const Eigen::Affine3f& transform,
                      int node) {
    const auto positions = attribute(primitive, "POSITION", 3);
    const auto normals = attribute(primitive, "NORMAL", 3);
    const auto colours = attribute(primitive, "COLOR_0", 3);
    const auto uvs = attribute(primitive, "TEXCOORD_0", 2);
    const auto list = indices(primitive, positions.size());
    const Eigen::Matrix3f turn = normal_transform(transform.linear());
    const bool mirrored = transform.linear().determinant() < 0;
    const ModelMaterial material = material_of(primitive);
    for (size_t n = 0; n + 3 <= list.size(); n += 3) {
      std::array<ModelCorner, 3> corners;
      for (size_t k = 0; k < 3; ++k) {
        const uint32_t v = list[n + (mirrored && k > 0 ? 3 - k : k)];
        corners[k].position = transform * positions[v];
        if (!(corners[k].position.cwiseAbs().maxCoeff<Eigen::PropagateNaN>() <= kMaxMetres)) {
          refuse("nodes[" + std::to_string(node) + "]: puts vertex " + std::to_string(v) +
                 " of its mesh too far away; expected vertices within 1000 km");
        }
        corners[k].normal =
            v < normals.size() ? unit_or_zero(turn * normals[v]) : Eigen::Vector3f::Zero().eval();
        if (v < colours.size()) corners[k].colour = colours[v];
        if (v < uvs.size()) corners[k].uv = uvs[v].head<2>();
      }
      set_missing_normals(corners);
      if (!builder_.add(corners, material)) {
        refuse("is too large: more than 4 million triangles with its textures");
      }
    }
  }

  /// Sets the normal of the triangle at corners without one.
  static void set_missing_normals(std::array<ModelCorner, 3>& corners) {
    if (corners[0].normal.norm() > 0.5F) return;
    const Eigen::Vector3f normal =
        unit_or_zero((corners[1].position - corners[0].position)
                         .cross(corners[2].position - corners[0].position));
    for (ModelCorner& corner : corners) corner.normal = normal;
  }

  ModelMaterial material_of(const tinygltf::Primitive& primitive) {
    ModelMaterial result;
    if (primitive.material < 0) return result;
    const tinygltf::Material& material = of(model_.materials, primitive.material);
    const auto& factor = material.pbrMetallicRoughness.baseColorFactor;
    for (size_t k = 0; k < 3 && k < factor.size(); ++k) {
      result.factor[static_cast<int>(k)] = static_cast<float>(std::clamp(factor[k], 0.0, 1.0));
    }
    result.texture = texture_of(material);
    result.unlit = material.extensions.contains("KHR_materials_unlit");
    return result;
  }

  fs::path path_;
  tinygltf::Model model_;
  ModelSurfaceBuilder builder_;
  std::map<int, Image> textures_;  ///< decoded, by index of the image
  int64_t texels_ = 0;             ///< of `textures_`
  size_t vertices_read_ = 0;       ///< rows of attributes
};

}  // namespace

ModelSurface parse_model(std::string_view bytes, const fs::path& path) {
  return Reader(bytes, path).read();
}

ModelSurface load_model(const fs::path& path) {
  return parse_model(io::value_or_throw(io::read_file(path, kMaxBytes)), path);
}

}  // namespace v3d::ctl
