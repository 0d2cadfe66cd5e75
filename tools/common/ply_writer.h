// A mesh as a PLY file.
#pragma once

#include <filesystem>

#include "base/mesh.h"

namespace v3d {

/// PLY 1.0, binary little endian, metres, z up: float x y z, uchar red green blue where the mesh
/// has colours, faces as uchar count and int indices. Replaces the file; throws std::runtime_error
/// when it cannot be written.
void write_ply(const std::filesystem::path& path, const Mesh& mesh);

}  // namespace v3d
