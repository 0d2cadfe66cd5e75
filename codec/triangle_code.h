// Codec of triangle indices, for meshes that are not the surface of a volume.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

namespace v3d {

/// Encodes triangles. Empty unless vertices are numbered in the order in which the triangles first
/// use them, and unused vertices come last.
std::optional<std::vector<uint8_t>> encode_triangles(
    std::span<const std::array<uint32_t, 3>> triangles, uint32_t vertices);

/// Decodes `triangles` triangles with indices below `vertices`. Empty when the bytes do not hold
/// exactly these.
std::optional<std::vector<std::array<uint32_t, 3>>> decode_triangles(std::span<const uint8_t> bytes,
                                                                     uint32_t triangles,
                                                                     uint32_t vertices);

}  // namespace v3d
