// PLY files of the true surface.
#pragma once

#include <filesystem>

#include "base/mesh.h"

namespace v3d::sim {

/// Binary little-endian PLY: float x y z, uchar red green blue when the mesh has colours, faces as
/// uchar count and int indices. Throws std::runtime_error when the disk refuses.
void write_ply(const std::filesystem::path& path, const Mesh& mesh);

}  // namespace v3d::sim
