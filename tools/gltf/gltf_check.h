// Checks of untrusted glTF 2.0 files that tinygltf does not do.
#pragma once

#include <filesystem>
#include <string_view>

namespace v3d {

/// Maximum number of ancestors of a node.
inline constexpr int kMaxNodeDepth = 64;

/// Checks the JSON of `file` before tinygltf reads it:
/// - it has at most 64 levels and 4 million values, and requires no extension except of materials
///   and KHR_texture_transform;
/// - the nodes are trees: each is the child of at most one node and not its own ancestor, and
///   scenes name roots, each once (chapters 3.5.2 and 5.25);
/// - every `uri` of a buffer or an image is data, or names a regular file in the folder of `file`
///   or below it, links resolved (RFC 3986 paths without scheme, authority, root or "..");
/// - every buffer view lies within its buffer.
/// Throws InputError: the file, the place in it, and what is expected.
/// Source: https://registry.khronos.org/glTF/specs/2.0/glTF-2.0.html
void check_gltf(std::string_view text, const std::filesystem::path& file);

/// Whether `path` exists and lies in `folder` or below it, symbolic links resolved in both.
bool lies_within(const std::filesystem::path& path, const std::filesystem::path& folder);

}  // namespace v3d
