#include <algorithm>
#include <cmath>
#include <map>

#include "base/core/error.h"
#include "base/image/image_files.h"
#include "base/io/file.h"
#include "gltf/gltf_file.h"
#include "v3dctl/scene/model.h"

namespace v3d::ctl {
namespace {

namespace fs = std::filesystem;

/// Limit of the pixels of all used textures together: one texture of the largest size.
constexpr int64_t kMaxTexels = int64_t{kMaxImageSide} * kMaxImageSide;
constexpr float kMaxMetres = 1e6F;

/// Transforms normals: the inverse transpose of `m` times a positive factor (its cofactors). Finite
/// also where `m` is singular.
Eigen::Matrix3f normal_transform(const Eigen::Matrix3f& m) {
  Eigen::Matrix3f cofactors;
  cofactors << m.col(1).cross(m.col(2)), m.col(2).cross(m.col(0)), m.col(0).cross(m.col(1));
  return m.determinant() < 0 ? (-cofactors).eval() : cofactors;
}

/// Reads one file. A bad index in it is an InputError and never a read out of bounds.
class Reader {
 public:
  Reader(std::string_view bytes, const fs::path& path) : file_(bytes, path) {}

  ModelSurface read() {
    if (file_.model().scenes.empty()) file_.fail("has no scene");
    const auto scene = static_cast<size_t>(std::max(0, file_.model().defaultScene));
    Eigen::Affine3f up = Eigen::Affine3f::Identity();
    up.linear() << 1, 0, 0, 0, 0, -1, 0, 1, 0;  // y up to z up
    for (const int node : file_.of(file_.model().scenes, static_cast<int>(scene)).nodes)
      read_node(node, up);
    if (builder_.surface().mesh.triangles.empty()) file_.fail("has no triangles");
    return builder_.take();
  }

 private:
  /// Recursive; check_gltf() limits the depth of nodes.
  void read_node(int index, const Eigen::Affine3f& parent) {
    const tinygltf::Node& node = file_.of(file_.model().nodes, index);
    const Eigen::Affine3f transform = parent * transform_of(node).parent_from_node().cast<float>();
    if (node.mesh >= 0) {
      for (const auto& primitive : file_.of(file_.model().meshes, node.mesh).primitives) {
        if (primitive.mode != TINYGLTF_MODE_TRIANGLES) continue;
        read_primitive(primitive, transform, index);
      }
    }
    for (const int child : node.children) read_node(child, transform);
  }

  /// Rows of `width` numbers of an attribute, with zeros behind them; empty if the primitive has
  /// none.
  std::vector<Eigen::Vector3f> attribute(const tinygltf::Primitive& primitive,
                                         const std::string& name, size_t width) {
    const auto found = primitive.attributes.find(name);
    if (found == primitive.attributes.end()) return {};
    const std::vector<float> numbers = file_.numbers(found->second, width, name);
    std::vector<Eigen::Vector3f> rows(numbers.size() / width, Eigen::Vector3f::Zero());
    for (size_t n = 0; n < numbers.size(); ++n) {
      rows[n / width][static_cast<int>(n % width)] = numbers[n];
    }
    return rows;
  }

  std::vector<uint32_t> indices(const tinygltf::Primitive& primitive, size_t vertices) {
    std::vector<uint32_t> list;
    if (primitive.indices < 0) {
      for (uint32_t v = 0; v < vertices; ++v) list.push_back(v);
      return list;
    }
    list = file_.integers(primitive.indices, 1, "indices");
    if (std::ranges::any_of(list, [&](uint32_t index) { return index >= vertices; })) {
      file_.fail("is a damaged glTF");
    }
    return list;
  }

  /// Texture of a material, decoded once; null without a texture.
  const Image* texture_of(const tinygltf::Material& material) {
    const int index = material.pbrMetallicRoughness.baseColorTexture.index;
    if (index < 0) return nullptr;
    const int source = file_.of(file_.model().textures, index).source;
    if (const auto known = textures_.find(source); known != textures_.end()) return &known->second;
    const std::vector<unsigned char>& bytes = file_.of(file_.model().images, source).image;
    const std::string_view text(reinterpret_cast<const char*>(bytes.data()), bytes.size());
    Image picture =
        decode_picture(text, file_.path().string() + ": images[" + std::to_string(source) + "]");
    texels_ += picture.size.pixels();
    if (texels_ > kMaxTexels) file_.fail("has textures of more than 268 million pixels together");
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
          file_.fail("nodes[" + std::to_string(node) + "]: puts vertex " + std::to_string(v) +
                     " of its mesh too far away; expected vertices within 1000 km");
        }
        corners[k].normal =
            v < normals.size() ? unit_or_zero(turn * normals[v]) : Eigen::Vector3f::Zero().eval();
        if (v < colours.size()) corners[k].colour = colours[v];
        if (v < uvs.size()) corners[k].uv = uvs[v].head<2>();
      }
      set_missing_normals(corners);
      if (!builder_.add(corners, material)) {
        file_.fail("is too large: more than 4 million triangles with its textures");
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
    const tinygltf::Material& material = file_.of(file_.model().materials, primitive.material);
    const auto& factor = material.pbrMetallicRoughness.baseColorFactor;
    for (size_t k = 0; k < 3 && k < factor.size(); ++k) {
      result.factor[static_cast<int>(k)] = static_cast<float>(std::clamp(factor[k], 0.0, 1.0));
    }
    result.texture = texture_of(material);
    result.unlit = material.extensions.contains("KHR_materials_unlit");
    return result;
  }

  GltfFile file_;
  ModelSurfaceBuilder builder_;
  std::map<int, Image> textures_;  ///< decoded, by index of the image
  int64_t texels_ = 0;             ///< of `textures_`
};

}  // namespace

ModelSurface parse_model(std::string_view bytes, const fs::path& path) {
  return Reader(bytes, path).read();
}

ModelSurface load_model(const fs::path& path) {
  return parse_model(io::value_or_throw(io::read_file(path, GltfFile::kMaxBytes)), path);
}

}  // namespace v3d::ctl
