// Colours as luma and chroma.
#pragma once

#include <algorithm>
#include <array>
#include <cstdint>

namespace v3d {

/// R, G, B.
using VertexColour = std::array<uint8_t, 3>;

/// Luma, Co, Cg and a 0, so they fit a vector register.
using LumaChroma = std::array<int16_t, 4>;

/// Luma (0 to 255), Co and Cg (-255 to 255) of the reversible YCoCg-R: colour_of() gives every
/// colour back. Source: Malvar and Sullivan, "YCoCg-R: a color space with RGB reversibility and low
/// dynamic range", JVT-I014, 2003.
LumaChroma luma_chroma_of(const VertexColour& colour);
/// Of any numbers: clamped to 0 to 255.
inline VertexColour colour_of(const LumaChroma& luma_chroma) {
  const auto [luma, co, cg, unused] = luma_chroma;
  const int middle = luma - (cg >> 1);
  const int blue = middle - (co >> 1);
  const auto byte = [](int value) { return static_cast<uint8_t>(std::clamp(value, 0, 255)); };
  return {byte(blue + co), byte(cg + middle), byte(blue)};
}

/// How luma and chroma are coded. Requires steps from 1 to kMostColourStep; 1, 1, 1 keeps every
/// bit.
///
/// A step q leaves an error of q * q / 12 on average and q / 2 at most; luma's counts fully in R, G
/// and B, that of Co a sixth and that of Cg a fourth. So the default leaves a mean squared error of
/// at most 9.1, which is 38.5 dB.
inline constexpr int kMostColourStep = 64;
using ColourSteps = std::array<uint8_t, 3>;
inline constexpr ColourSteps kDefaultColourSteps{6, 15, 12};

}  // namespace v3d
