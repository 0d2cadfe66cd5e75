// Reader of OBJ files.
#pragma once

#include <filesystem>

#include "base/geometry/mesh.h"

namespace v3d {

/// Positions and faces of a Wavefront OBJ file; faces with more than three corners become
/// triangles. Materials, normals and texture coordinates are ignored. Throws InputError with the
/// path when the file cannot be read, has no face, has a vertex that is not finite, or names one
/// that it does not have.
Mesh read_obj(const std::filesystem::path& path);

}  // namespace v3d
