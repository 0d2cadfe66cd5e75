// Triangles that no volume explains, for meshes that are no surface of bricks.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

namespace v3d {

/// Empty unless vertices are numbered in the order in which the triangles first use them, those
/// that no triangle uses last.
std::optional<std::vector<uint8_t>> encode_triangles(
    std::span<const std::array<uint32_t, 3>> triangles, uint32_t vertices);

/// Such triangles; empty for bytes that do not hold so many.
std::optional<std::vector<std::array<uint32_t, 3>>> decode_triangles(std::span<const uint8_t> bytes,
                                                                     uint32_t triangles,
                                                                     uint32_t vertices);

}  // namespace v3d
