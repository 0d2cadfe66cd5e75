// Lossless codec of three integers per vertex (displacement or position), predicted from
// neighbouring vertices.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "codec/known_vertices.h"

namespace v3d {

/// The fourth is 0 and fills a vector register.
using VertexValues = std::array<int32_t, 4>;

/// Range of values. Requires -2^19 <= min <= 0 <= max < 2^19.
struct ValueRange {
  int min = 0, max = 0;
};

/// Requires values in `range` for all vertices of `known`.
std::vector<uint8_t> encode_values(std::span<const VertexValues> values, const KnownVertices& known,
                                   const ValueRange& range);

/// Returns the values by vertex. Empty when the bytes do not have exactly the length that an
/// encoder writes.
std::optional<std::vector<VertexValues>> decode_values(std::span<const uint8_t> bytes,
                                                       const KnownVertices& known,
                                                       const ValueRange& range);

}  // namespace v3d
