// Models of a scene: reader of glTF 2.0 files, surface.
#pragma once

#include <Eigen/Geometry>
#include <array>
#include <filesystem>
#include <string_view>
#include <vector>

#include "base/geometry/mesh.h"
#include "base/image/image.h"

namespace v3d::ctl {

// Coloured surface of a computer graphics model, and its lighting.

/// Triangles in the axes of the world (metres, z up) with their material per vertex.
struct ModelSurface {
  Mesh mesh;                             ///< without colours
  std::vector<Eigen::Vector3f> normals;  ///< unit length
  std::vector<Eigen::Vector3f> albedo;   ///< linear, 0 to 1
  std::vector<uint8_t> unlit;            ///< 1: shown without lighting
};

/// Corner of a triangle of the model.
struct ModelCorner {
  Eigen::Vector3f position, normal;  ///< metres; unit length or zero
  Eigen::Vector3f colour = Eigen::Vector3f::Ones();
  Eigen::Vector2f uv = Eigen::Vector2f::Zero();  ///< 1: width and height of the texture
};

/// What a texture shows beyond its edges.
enum class TextureWrap { kRepeat, kClamp, kMirror };

struct ModelMaterial {
  Eigen::Vector3f factor = Eigen::Vector3f::Ones();  ///< of the colour, linear
  const Image* texture = nullptr;                    ///< RGB8; borrowed
  TextureWrap wrap_u = TextureWrap::kRepeat, wrap_v = TextureWrap::kRepeat;
  bool unlit = false;
};

/// `v` with length 1; zero where it has no direction.
Eigen::Vector3f unit_or_zero(const Eigen::Vector3f& v);

/// Builds a surface from textured triangles. Textures become vertex colours: a triangle is
/// subdivided until its edges are about three texels long. One thread.
class ModelSurfaceBuilder {
 public:
  /// Adds a triangle. Returns false, and adds nothing, if the surface would have more than 4
  /// million triangles.
  bool add(const std::array<ModelCorner, 3>& corners, const ModelMaterial& material);
  const ModelSurface& surface() const { return surface_; }
  ModelSurface take() { return std::move(surface_); }

 private:
  void add_vertex(const ModelCorner& corner, const ModelMaterial& material);

  ModelSurface surface_;
};

/// Limit of triangles of a surface.
inline constexpr size_t kMaxModelTriangles = 4'000'000;

/// Mesh of the model in the world, lit as in tools/viewer (docs/scene.md): a sun from above, and a
/// sky that is brighter than the ground. Colours are sRGB.
Mesh lit_model(const ModelSurface& model, const Eigen::Affine3d& world_from_model);

// Reader of glTF 2.0 models.

/// Reads the default scene of a file: triangles, base colours and their textures, without animation
/// and transparency; y up becomes z up. A skin has the pose of its joints without animation. The
/// file is binary or JSON, of at most 512 MB; it may refer to files in its folder only. All numbers
/// of the result are finite. Memory is bounded: 4 million triangles, 268 million texels. Throws
/// InputError, one line with the file and the place in it: no glTF 2.0, no triangles, anything that
/// check_gltf() rejects, numbers that are not finite, vertices beyond 1000 km.
ModelSurface load_model(const std::filesystem::path& path);

/// As load_model(), from the bytes of a file. `path`: its path, for messages and for the folder of
/// other files.
ModelSurface parse_model(std::string_view bytes, const std::filesystem::path& path);

}  // namespace v3d::ctl
