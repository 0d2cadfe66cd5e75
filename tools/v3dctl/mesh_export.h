// A coloured mesh as a file for other programs: one writer per format.
#pragma once

#include <filesystem>
#include <string_view>

#include "base/mesh.h"

namespace v3d::ctl {

enum class MeshFormat { kPly, kObj, kGlb };

/// "ply", "obj", "glb"; throws InputError for anything else.
MeshFormat parse_mesh_format(std::string_view text);
std::string_view extension(MeshFormat format);  ///< with the dot

/// Metres, z up, colours as in the images (sRGB); a mesh without colours is written without.
/// Replaces the file. Throws std::runtime_error when it cannot be written.
void write_mesh(const std::filesystem::path& path, MeshFormat format, const Mesh& mesh);

/// The parts of write_mesh(); PLY is common/ply_writer.h.
///   Wavefront OBJ with the widespread extension "v x y z r g b", colours 0..1.
void write_obj(const std::filesystem::path& path, const Mesh& mesh);
///   glTF 2.0 binary: POSITION and COLOR_0 (linear light, as the standard wants), unlit, with a
///   node that turns z up into the standard's y up. A mesh without triangles gives an empty scene.
void write_glb(const std::filesystem::path& path, const Mesh& mesh);

}  // namespace v3d::ctl
