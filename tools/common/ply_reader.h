// A PLY file as a mesh, whichever program wrote it.
#pragma once

#include <filesystem>
#include <string>
#include <string_view>

#include "base/geometry/mesh.h"

namespace v3d {

/// PLY 1.0, binary little endian: vertices with x, y, z (float or double), with red, green, blue
/// (uchar) where they are there, and faces of which those with more than three corners become fans.
/// Other properties are passed over. Throws InputError, which begins with `name`, for anything
/// else, for truncated bytes, and for an index without its vertex.
Mesh parse_ply(std::string_view bytes, const std::string& name);

/// The same of a file; throws InputError also when it cannot be read.
Mesh read_ply(const std::filesystem::path& path);

}  // namespace v3d
