// Reads the meshes that evaluation compares with.
#pragma once

#include <filesystem>

#include "base/mesh.h"

namespace v3d::ctl {

/// PLY 1.0, binary little endian: vertices with x, y, z (float or double), with red, green, blue
/// (uchar) where they are there, and faces of which those with more than three corners become fans.
/// Other properties are passed over. Throws InputError for anything else, for a truncated file, and
/// for an index without its vertex.
Mesh read_ply(const std::filesystem::path& path);

}  // namespace v3d::ctl
