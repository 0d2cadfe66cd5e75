// Reader of PLY files from any program.
#pragma once

#include <filesystem>
#include <string>
#include <string_view>

#include "base/geometry/mesh.h"

namespace v3d {

/// Parses PLY 1.0, binary little endian.
///
/// Vertices have x, y, z (float or double) and optionally red, green, blue (uchar). Faces with more
/// than three corners become triangle fans. Other properties are ignored. Throws InputError, whose
/// message begins with `name`, for any other content, truncated bytes, or an index without its
/// vertex.
Mesh parse_ply(std::string_view bytes, const std::string& name);

/// The same for a file. Throws InputError also when the file cannot be read.
Mesh read_ply(const std::filesystem::path& path);

}  // namespace v3d
