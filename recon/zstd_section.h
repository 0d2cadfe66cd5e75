// One Zstandard frame with its content size and checksum: a section of a compact frame.
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <vector>

namespace v3d {

/// Equal content gives equal bytes (with one version of the library).
std::vector<uint8_t> compress_section(std::span<const uint8_t> content);

/// Nothing when the bytes are not exactly one frame, when its checksum is missing or wrong, or when
/// it states a content size outside [least, most]; that is checked before memory is taken for it.
std::optional<std::vector<uint8_t>> decompress_section(std::span<const uint8_t> section,
                                                       size_t least, size_t most);

}  // namespace v3d
