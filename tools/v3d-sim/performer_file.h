// Reader of performers from glTF 2.0 files.
#pragma once

#include <filesystem>
#include <memory>
#include <string>
#include <string_view>

#include "sim/performer/skinned_model.h"

namespace v3d::sim {

/// Reads the skinned meshes of a glTF file, their skins and one animation. `animation`: its name;
/// empty: the first one of the file.
///
/// Reads triangles with POSITION, JOINTS_0 and WEIGHTS_0; materials, textures and morph targets are
/// ignored. Limits: GltfFile, 1 million vertices, 2 million triangles, 1,000 joints, 10,000 nodes.
/// Throws InputError, one line with the file, the place in it and what is expected: no file, no
/// glTF, no skin, no animation of that name, numbers that are not finite, weights whose sum is 0,
/// indices out of range; a body that is not 0.5 to 2.4 m high, or leaves the studio's space.
std::shared_ptr<const SkinnedModel> load_performer(const std::filesystem::path& path,
                                                   const std::string& animation);

/// As load_performer(), from the bytes of a file. `path`: for messages and for the folder of other
/// files.
std::shared_ptr<const SkinnedModel> parse_performer(std::string_view bytes,
                                                    const std::filesystem::path& path,
                                                    const std::string& animation);

}  // namespace v3d::sim
