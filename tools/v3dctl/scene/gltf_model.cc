#include <algorithm>
#include <cmath>
#include <map>
#include <optional>
#include <utility>

#include "base/core/error.h"
#include "base/image/image_files.h"
#include "base/io/file.h"
#include "gltf/gltf_file.h"
#include "v3dctl/scene/gltf_skin.h"
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

/// From y up to z up.
Eigen::Affine3f z_up() {
  Eigen::Affine3f up = Eigen::Affine3f::Identity();
  up.linear() << 1, 0, 0, 0, 0, -1, 0, 1, 0;
  return up;
}

/// How vertices are transformed, or one of them.
struct Placement {
  explicit Placement(const Eigen::Affine3f& to_scene)
      : transform(to_scene),
        turn(normal_transform(to_scene.linear())),
        mirrored(to_scene.linear().determinant() < 0) {}

  Eigen::Affine3f transform;
  Eigen::Matrix3f turn;  ///< of normals
  bool mirrored;
};

/// The vertices of a primitive. Lists other than the positions can be shorter, or empty.
struct Vertices {
  std::vector<Eigen::Vector3f> positions, normals, colours, uvs;
  Placement whole;                 ///< of all of them
  std::optional<VertexSkin> skin;  ///< instead

  Placement placement(uint32_t v) const { return skin ? Placement(skin->at(v)) : whole; }
};

/// Three corners for each triangle of a list, a strip or a fan.
std::vector<uint32_t> triangle_corners(std::vector<uint32_t> list, int mode) {
  if (mode == TINYGLTF_MODE_TRIANGLES) return list;
  std::vector<uint32_t> corners;
  for (size_t n = 0; n + 2 < list.size(); ++n) {
    const size_t odd = n % 2;  // the triangles of a strip turn left and right in turn
    const bool is_strip = mode == TINYGLTF_MODE_TRIANGLE_STRIP;
    corners.push_back(is_strip ? list[n] : list[n + 1]);
    corners.push_back(is_strip ? list[n + 1 + odd] : list[n + 2]);
    corners.push_back(is_strip ? list[n + 2 - odd] : list[0]);
  }
  return corners;
}

/// A pair of numbers of an extension.
Eigen::Vector2d pair_in(const tinygltf::Value& object, const std::string& key, double missing) {
  if (!object.Has(key) || object.Get(key).ArrayLen() != 2) {
    return Eigen::Vector2d::Constant(missing);
  }
  const tinygltf::Value& list = object.Get(key);
  return {list.Get(0).GetNumberAsDouble(), list.Get(1).GetNumberAsDouble()};
}

/// Which coordinates of the vertices a texture has, and how they become those of its picture.
struct TextureCoordinates {
  int set = 0;                             ///< of TEXCOORD_set
  std::optional<Eigen::Affine2d> picture;  ///< picture_from_uv of KHR_texture_transform
};

TextureCoordinates coordinates_of(const tinygltf::TextureInfo& texture) {
  TextureCoordinates result{.set = texture.texCoord, .picture = {}};
  const auto found = texture.extensions.find("KHR_texture_transform");
  if (found == texture.extensions.end()) return result;
  const tinygltf::Value& transform = found->second;
  if (transform.Has("texCoord") && transform.Get("texCoord").IsInt()) {
    result.set = transform.Get("texCoord").GetNumberAsInt();
  }
  const double angle =
      transform.Has("rotation") ? transform.Get("rotation").GetNumberAsDouble() : 0;
  Eigen::Matrix2d turn;  // counter-clockwise where v points down
  turn << std::cos(angle), std::sin(angle), -std::sin(angle), std::cos(angle);
  result.picture.emplace(Eigen::Affine2d::Identity());
  result.picture->linear() = turn * pair_in(transform, "scale", 1).asDiagonal();
  result.picture->translation() = pair_in(transform, "offset", 0);
  return result;
}

TextureWrap wrap_of(int mode) {
  if (mode == TINYGLTF_TEXTURE_WRAP_CLAMP_TO_EDGE) return TextureWrap::kClamp;
  if (mode == TINYGLTF_TEXTURE_WRAP_MIRRORED_REPEAT) return TextureWrap::kMirror;
  return TextureWrap::kRepeat;
}

/// Reads one file. A bad index in it is an InputError and never a read out of bounds.
class Reader {
 public:
  Reader(std::string_view bytes, const fs::path& path)
      : file_(bytes, path), skins_(file_, z_up()) {}

  ModelSurface read() {
    if (file_.model().scenes.empty()) file_.fail("has no scene");
    const auto scene = static_cast<size_t>(std::max(0, file_.model().defaultScene));
    for (const int node : file_.of(file_.model().scenes, static_cast<int>(scene)).nodes)
      read_node(node, z_up());
    if (builder_.surface().mesh.triangles.empty()) file_.fail("has no triangles");
    return builder_.take();
  }

 private:
  /// Recursive; check_gltf() limits the depth of nodes.
  void read_node(int index, const Eigen::Affine3f& parent) {
    const tinygltf::Node& node = file_.of(file_.model().nodes, index);
    const Eigen::Affine3f transform = parent * transform_of(node).parent_from_node().cast<float>();
    if (node.mesh >= 0) {
      const auto& primitives = file_.of(file_.model().meshes, node.mesh).primitives;
      for (size_t p = 0; p < primitives.size(); ++p) {
        if (primitives[p].mode < TINYGLTF_MODE_TRIANGLES) continue;  // points and lines
        const std::string where =
            "meshes[" + std::to_string(node.mesh) + "].primitives[" + std::to_string(p) + "]";
        read_primitive(primitives[p], vertices_of(primitives[p], node.skin, transform, where),
                       index, where);
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

  /// The vertices at the corners of the triangles.
  std::vector<uint32_t> indices(const tinygltf::Primitive& primitive, size_t vertices) {
    std::vector<uint32_t> list;
    if (primitive.indices < 0) {
      for (uint32_t v = 0; v < vertices; ++v) list.push_back(v);
    } else {
      list = file_.integers(primitive.indices, 1, "indices");
    }
    if (std::ranges::any_of(list, [&](uint32_t index) { return index >= vertices; })) {
      file_.fail("is a damaged glTF");
    }
    return triangle_corners(std::move(list), primitive.mode);
  }

  /// Only the joints of a skin place its vertices (section 3.7.3.3): `transform`, of the node, does
  /// not count then.
  Vertices vertices_of(const tinygltf::Primitive& primitive, int skin,
                       const Eigen::Affine3f& transform, const std::string& where) {
    Vertices result{.positions = attribute(primitive, "POSITION", 3),
                    .normals = attribute(primitive, "NORMAL", 3),
                    .colours = attribute(primitive, "COLOR_0", 3),
                    .uvs = texture_coordinates(primitive, where),
                    .whole = Placement(transform),
                    .skin = {}};
    if (skin >= 0) {
      result.skin.emplace(file_, primitive, skins_.joints(skin), result.positions.size(), where);
    }
    return result;
  }

  /// The coordinates of the base colour texture in its picture.
  std::vector<Eigen::Vector3f> texture_coordinates(const tinygltf::Primitive& primitive,
                                                   const std::string& where) {
    TextureCoordinates coordinates;
    if (primitive.material >= 0) {
      coordinates = coordinates_of(file_.of(file_.model().materials, primitive.material)
                                       .pbrMetallicRoughness.baseColorTexture);
    }
    auto uvs = attribute(primitive, "TEXCOORD_" + std::to_string(coordinates.set), 2);
    if (!coordinates.picture) return uvs;
    for (Eigen::Vector3f& uv : uvs) {
      const Eigen::Vector2d there = *coordinates.picture * uv.head<2>().cast<double>();
      if (!(std::abs(there.x()) <= GltfFile::kMaxValue &&
            std::abs(there.y()) <= GltfFile::kMaxValue)) {
        file_.fail(where +
                   ": KHR_texture_transform makes texture coordinates that are not finite, "
                   "or beyond a thousand million; expected finite numbers");
      }
      uv.head<2>() = there.cast<float>();
    }
    return uvs;
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

  void read_primitive(const tinygltf::Primitive& primitive, const Vertices& vertices, int node,
                      const std::string& where) {
    if (primitive.mode > TINYGLTF_MODE_TRIANGLE_FAN) {
      file_.fail(where + ": mode " + std::to_string(primitive.mode) +
                 " does not exist; expected 0 to 6");
    }
    const auto list = indices(primitive, vertices.positions.size());
    const ModelMaterial material = material_of(primitive);
    for (size_t n = 0; n + 3 <= list.size(); n += 3) {
      const bool mirrored = vertices.placement(list[n]).mirrored;
      std::array<ModelCorner, 3> corners;
      for (size_t k = 0; k < 3; ++k) {
        corners[k] = corner(vertices, list[n + (mirrored && k > 0 ? 3 - k : k)], node);
      }
      set_missing_normals(corners);
      if (!builder_.add(corners, material)) {
        file_.fail("is too large: more than 4 million triangles with its textures");
      }
    }
  }

  ModelCorner corner(const Vertices& vertices, uint32_t v, int node) const {
    const Placement placement = vertices.placement(v);
    ModelCorner result;
    result.position = placement.transform * vertices.positions[v];
    if (!(result.position.cwiseAbs().maxCoeff<Eigen::PropagateNaN>() <= kMaxMetres)) {
      file_.fail("nodes[" + std::to_string(node) + "]: puts vertex " + std::to_string(v) +
                 " of its mesh too far away; expected vertices within 1000 km");
    }
    result.normal = v < vertices.normals.size() ? unit_or_zero(placement.turn * vertices.normals[v])
                                                : Eigen::Vector3f::Zero().eval();
    if (v < vertices.colours.size()) result.colour = vertices.colours[v];
    if (v < vertices.uvs.size()) result.uv = vertices.uvs[v].head<2>();
    return result;
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
    set_wrap(material, result);
    result.unlit = material.extensions.contains("KHR_materials_unlit");
    return result;
  }

  /// What lies beyond the edges of the texture, by its sampler.
  void set_wrap(const tinygltf::Material& material, ModelMaterial& result) const {
    if (result.texture == nullptr) return;
    const int texture = material.pbrMetallicRoughness.baseColorTexture.index;
    const int sampler = file_.of(file_.model().textures, texture).sampler;
    if (sampler < 0) return;
    result.wrap_u = wrap_of(file_.of(file_.model().samplers, sampler).wrapS);
    result.wrap_v = wrap_of(file_.of(file_.model().samplers, sampler).wrapT);
  }

  GltfFile file_;
  GltfSkins skins_;
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
