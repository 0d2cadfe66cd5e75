// Lossless codec of one label for each vertex: to which performer it belongs.
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "codec/vertex_values.h"

namespace v3d::codec {

/// Requires a label for each vertex of `known`.
std::vector<uint8_t> encode_labels(std::span<const uint8_t> labels, const KnownVertices& known);

/// Returns the labels by vertex. Empty when the bytes do not have exactly the length that an
/// encoder writes.
std::optional<std::vector<uint8_t>> decode_labels(std::span<const uint8_t> bytes,
                                                  const KnownVertices& known);

}  // namespace v3d::codec
