// Encoder and decoder of the colours of a surface. A colour is predicted from neighbouring vertices
// or from the previous frame. docs/compact-frame.md is normative.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "codec/colour.h"
#include "codec/known_vertices.h"

namespace v3d {

/// Colours of the previous frame at the vertices of this frame.
class PreviousColours {
 public:
  PreviousColours() = default;
  virtual ~PreviousColours() = default;
  PreviousColours(const PreviousColours&) = delete;
  PreviousColours& operator=(const PreviousColours&) = delete;
  /// Null when the previous frame has no colour there. Valid as long as this object.
  virtual const LumaChroma* at(uint32_t vertex) const = 0;
};

struct CodedColours {
  std::vector<uint8_t> bytes;
  std::vector<LumaChroma> decoded;  ///< [vertex]: colours that the decoder reconstructs
};

/// Requires one colour for every vertex of `known`. Without `previous`, nothing is predicted from
/// the previous frame.
CodedColours encode_colours(std::span<const LumaChroma> colours, const KnownVertices& known,
                            const ColourSteps& steps, const PreviousColours* previous);

/// Returns the colours by vertex. Empty when the bytes do not have exactly the length that an
/// encoder writes, or when a table is invalid.
std::optional<std::vector<LumaChroma>> decode_colours(std::span<const uint8_t> bytes,
                                                      const KnownVertices& known,
                                                      const ColourSteps& steps,
                                                      const PreviousColours* previous);

}  // namespace v3d
