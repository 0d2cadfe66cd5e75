// A mesh as a PLY file.
#pragma once

#include <array>
#include <cstdint>
#include <filesystem>
#include <span>
#include <string>

#include "base/geometry/mesh.h"

namespace v3d {

/// Four more properties of the vertices, uchar each. Names have neither spaces nor line breaks.
struct PlyColours {
  std::string comment;  ///< a line about them
  std::array<std::string, 4> properties;
  std::span<const std::array<uint8_t, 4>> vertices;  ///< borrowed; one for each vertex
};

/// PLY 1.0, binary little endian, metres, z up: float x y z, uchar red green blue where the mesh
/// has colours, then `more`, faces as uchar count and int indices. Replaces the file; throws
/// std::runtime_error when it cannot be written.
void write_ply(const std::filesystem::path& path, const Mesh& mesh,
               std::span<const PlyColours> more = {});

}  // namespace v3d
