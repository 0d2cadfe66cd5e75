// Reader of glTF 2.0 models.
#pragma once

#include <filesystem>
#include <string_view>

#include "v3dctl/scene/model_surface.h"

namespace v3d::ctl {

/// Reads the default scene of a file: triangles, base colours and their textures, without animation
/// and transparency; y up becomes z up. The file is binary or JSON, of at most 512 MB; it may refer
/// to files in its folder only (gltf_check.h). All numbers of the result are finite. Memory is
/// bounded: 4 million triangles, 268 million texels. Throws InputError, one line with the file and
/// the place in it: no glTF 2.0, no triangles, anything that check_gltf() rejects, numbers that are
/// not finite, vertices beyond 1000 km.
ModelSurface load_model(const std::filesystem::path& path);

/// As load_model(), from the bytes of a file. `path`: its path, for messages and for the folder of
/// other files.
ModelSurface parse_model(std::string_view bytes, const std::filesystem::path& path);

}  // namespace v3d::ctl
