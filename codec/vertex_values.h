// Three numbers of every vertex - colour, displacement or position - predicted from the surface
// round it, or from the frame before.
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

/// What a kind of values is like. Requires -2^19 <= least <= first <= most < 2^19.
struct ValueRange {
  VertexValues step{1, 1, 1};  ///< of quantisation
  VertexValues least{}, most{};
  VertexValues first{};  ///< predicted where nothing is known
};

/// What the frame before had where a vertex stands now.
class FormerValues {
 public:
  FormerValues() = default;
  virtual ~FormerValues() = default;
  FormerValues(const FormerValues&) = delete;
  FormerValues& operator=(const FormerValues&) = delete;
  /// Null where it had none; valid as long as this.
  virtual const VertexValues* at(uint32_t vertex) const = 0;
};

struct CodedValues {
  std::vector<uint8_t> bytes;
  std::vector<VertexValues> decoded;  ///< [vertex]: what the decoder will have
};

/// Requires values in their range for all vertices of `known`. Without `former` nothing is
/// predicted from a frame before.
CodedValues encode_values(std::span<const VertexValues> values, const KnownVertices& known,
                          const ValueRange& range, const FormerValues* former);

/// Empty for bytes that are not exactly an encoder's length. [vertex].
std::optional<std::vector<VertexValues>> decode_values(std::span<const uint8_t> bytes,
                                                       const KnownVertices& known,
                                                       const ValueRange& range,
                                                       const FormerValues* former);

}  // namespace v3d
