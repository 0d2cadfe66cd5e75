// Colours: interface of the coder and conversion.
#pragma once

#include <algorithm>
#include <array>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "codec/vertex_values.h"

namespace v3d::codec {

// Conversion of RGB colours to luma and chroma, and steps of their quantisation.

/// R, G, B.
using VertexColour = std::array<uint8_t, 3>;

/// Luma, Co, Cg and a 0 that fills a vector register.
using LumaChroma = std::array<int16_t, 4>;

/// Converts to luma (0 to 255), Co and Cg (-255 to 255) of the reversible YCoCg-R. colour_of()
/// restores every colour exactly.
/// Source: Malvar and Sullivan, "YCoCg-R: a color space with RGB reversibility and low dynamic
/// range", JVT-I014, 2003.
LumaChroma luma_chroma_of(const VertexColour& colour);
/// Converts to RGB. Accepts any numbers and clamps the result to 0 to 255.
inline VertexColour colour_of(const LumaChroma& luma_chroma) {
  const auto [luma, co, cg, unused] = luma_chroma;
  const int middle = luma - (cg >> 1);
  const int blue = middle - (co >> 1);
  const auto byte = [](int value) { return static_cast<uint8_t>(std::clamp(value, 0, 255)); };
  return {byte(blue + co), byte(cg + middle), byte(blue)};
}

/// Steps of quantisation of luma, Co and Cg, from 1 to kMaxColourStep; 1, 1, 1 is lossless.
///
/// A step q causes a squared error of q * q / 12 on average and an error of at most q / 2. The
/// error of luma contributes fully to R, G and B, that of Co one sixth, that of Cg one fourth. So
/// the default causes a mean squared error of at most 9.1, which is 38.5 dB.
inline constexpr int kMaxColourStep = 64;
using ColourSteps = std::array<uint8_t, 3>;
inline constexpr ColourSteps kDefaultColourSteps{6, 15, 12};

// Encoder and decoder of the colours of a surface. A colour is predicted from neighbouring vertices
// or from the previous frame. docs/compact-frame.md is normative.

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

/// Requires one colour of luma_chroma_of() for every vertex of `known`. Without `previous`, nothing
/// is predicted from the previous frame.
CodedColours encode_colours(std::span<const LumaChroma> colours, const KnownVertices& known,
                            const ColourSteps& steps, const PreviousColours* previous);

/// Returns the colours by vertex. Empty when the bytes do not have exactly the length that an
/// encoder writes, or when a table is invalid.
std::optional<std::vector<LumaChroma>> decode_colours(std::span<const uint8_t> bytes,
                                                      const KnownVertices& known,
                                                      const ColourSteps& steps,
                                                      const PreviousColours* previous);

}  // namespace v3d::codec
