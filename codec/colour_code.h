// The colours of a surface, predicted from the colours round them or from the frame before.
// docs/compact-frame.md has the normative description.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "codec/colour.h"
#include "codec/known_vertices.h"

namespace v3d {

/// What the frame before had where a vertex stands now.
class FormerColours {
 public:
  FormerColours() = default;
  virtual ~FormerColours() = default;
  FormerColours(const FormerColours&) = delete;
  FormerColours& operator=(const FormerColours&) = delete;
  /// Null where it had none; valid as long as this.
  virtual const LumaChroma* at(uint32_t vertex) const = 0;
};

struct CodedColours {
  std::vector<uint8_t> bytes;
  std::vector<LumaChroma> decoded;  ///< [vertex]: what the decoder will have
};

/// Requires a colour for every vertex of `known`. Without `former` nothing is predicted from a
/// frame before.
CodedColours encode_colours(std::span<const LumaChroma> colours, const KnownVertices& known,
                            const ColourSteps& steps, const FormerColours* former);

/// Empty for bytes that are not exactly an encoder's length, or whose tables are not sound.
/// [vertex].
std::optional<std::vector<LumaChroma>> decode_colours(std::span<const uint8_t> bytes,
                                                      const KnownVertices& known,
                                                      const ColourSteps& steps,
                                                      const FormerColours* former);

}  // namespace v3d
