// Three whole numbers of every vertex - displacement or position - predicted from the surface round
// it; coded without loss.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "codec/known_vertices.h"

namespace v3d {

/// The fourth is 0: so they fit a vector register.
using VertexValues = std::array<int32_t, 4>;

/// Where values lie. Requires -2^19 <= least <= 0 <= most < 2^19.
struct ValueRange {
  int least = 0, most = 0;
};

/// Requires values in their range for all vertices of `known`.
std::vector<uint8_t> encode_values(std::span<const VertexValues> values, const KnownVertices& known,
                                   const ValueRange& range);

/// Empty for bytes that are not exactly an encoder's length. [vertex].
std::optional<std::vector<VertexValues>> decode_values(std::span<const uint8_t> bytes,
                                                       const KnownVertices& known,
                                                       const ValueRange& range);

}  // namespace v3d
