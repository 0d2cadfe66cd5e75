// A model of computer graphics (glTF 2.0) as a coloured surface.
#pragma once

#include <Eigen/Geometry>
#include <filesystem>
#include <string_view>
#include <vector>

#include "base/mesh.h"

namespace v3d::ctl {

/// Triangles in the axes of our world (metres, z up; glTF has y up), with what becomes of light.
/// Textures are in the colours of the vertices: triangles with a texture are cut so finely that
/// little of it is lost.
struct ModelSurface {
  Mesh mesh;                             ///< without colours
  std::vector<Eigen::Vector3f> normals;  ///< unit
  std::vector<Eigen::Vector3f> albedo;   ///< linear, 0 to 1
  std::vector<uint8_t> unlit;            ///< 1: shown as it is, no light falls on it
};

/// The file's default scene: triangles, base colours and their textures; no animation, no
/// transparency. A binary file or JSON of at most 512 MB; other files are read from its folder only
/// (gltf_check.h). All numbers of the result are finite. Memory is bounded: 4 million triangles,
/// 268 million texels.
/// Throws InputError, one line with the file and the place in it: no glTF 2.0, no triangles, what
/// check_gltf() refuses, numbers that are not finite, vertices beyond 1000 km.
ModelSurface load_model(const std::filesystem::path& path);

/// As load_model(), from the bytes of a file. `path`: its path, for messages and for the folder of
/// other files.
ModelSurface parse_model(std::string_view bytes, const std::filesystem::path& path);

/// In the world, under the light that tools/viewer puts there: from above, and from a sky that is
/// brighter than the ground. Colours are sRGB.
Mesh lit_model(const ModelSurface& model, const Eigen::Affine3d& world_from_model);

}  // namespace v3d::ctl
