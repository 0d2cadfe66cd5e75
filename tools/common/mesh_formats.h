// Files of meshes: reader and writer of PLY, reader of OBJ.
#pragma once

#include <array>
#include <cstdint>
#include <filesystem>
#include <span>
#include <string>
#include <string_view>

#include "base/geometry/mesh.h"

namespace v3d {

// Reader of PLY files from any program.

/// Parses PLY 1.0, binary little endian.
///
/// Vertices have x, y, z (float or double) and optionally red, green, blue (uchar). Faces with more
/// than three corners become triangle fans. Other properties are ignored. Throws InputError, whose
/// message begins with `name`, for any other content, truncated bytes, or an index without its
/// vertex.
Mesh parse_ply(std::string_view bytes, const std::string& name);

/// The same for a file. Throws InputError also when the file cannot be read.
Mesh read_ply(const std::filesystem::path& path);

// Writer of PLY files.

/// Four additional properties of each vertex, of type uchar. Names contain no spaces or line
/// breaks.
struct PlyColours {
  std::string comment;  ///< comment line for the header
  std::array<std::string, 4> properties;
  std::span<const std::array<uint8_t, 4>> vertices;  ///< borrowed; one for each vertex
};

/// Writes `mesh` as PLY 1.0, binary little endian, in metres, z up.
///
/// Vertices: float x y z, uchar red green blue if the mesh has colours, then `more`. Faces: uchar
/// count and int indices. Replaces the file. Throws std::runtime_error when it cannot be written.
void write_ply(const std::filesystem::path& path, const Mesh& mesh,
               std::span<const PlyColours> more = {});

// Reader of OBJ files.

/// Positions and faces of a Wavefront OBJ file; faces with more than three corners become
/// triangles. Materials, normals and texture coordinates are ignored. Throws InputError with the
/// path when the file cannot be read, has no face, has a vertex that is not finite, or names one
/// that it does not have.
Mesh read_obj(const std::filesystem::path& path);

}  // namespace v3d
