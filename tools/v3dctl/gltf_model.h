// A model of computer graphics (glTF 2.0) as a coloured surface.
#pragma once

#include <Eigen/Geometry>
#include <filesystem>
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
/// transparency. Throws InputError for what is no glTF, or has no triangles.
ModelSurface load_model(const std::filesystem::path& path);

/// In the world, under the light that tools/viewer puts there: from above, and from a sky that is
/// brighter than the ground. Colours are sRGB.
Mesh lit_model(const ModelSurface& model, const Eigen::Affine3d& world_from_model);

}  // namespace v3d::ctl
