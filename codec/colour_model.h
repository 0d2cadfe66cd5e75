// Prediction of colours and symbols of their residuals, shared by encoder and decoder.
// docs/compact-frame.md is normative.
#pragma once

#include <algorithm>
#include <array>
#include <bit>
#include <cstdint>
#include <cstdlib>

#include "codec/colour_code.h"
#include "codec/entropy_coder.h"
#include "codec/vertex_values.h"

namespace v3d::codec {

/// Number of consecutive vertices that share the choice of prediction (surface or previous frame).
inline constexpr uint32_t kColourGroup = 64;

/// The four numbers of a colour in a vector register, by the vector extension of GCC and Clang.
/// Their code for loops over an array of 16-bit numbers takes twice as long.
using Lanes [[gnu::vector_size(8)]] = int16_t;
inline Lanes lanes_of(const LumaChroma& colour) { return std::bit_cast<Lanes>(colour); }
inline LumaChroma colour_in(Lanes lanes) { return std::bit_cast<LumaChroma>(lanes); }
inline Lanes min_of(Lanes a, Lanes b) { return a < b ? a : b; }
inline Lanes max_of(Lanes a, Lanes b) { return a > b ? a : b; }

/// Prediction of one vertex, and the spread of the colours that it is computed from.
struct ColourPrediction {
  Lanes mean;
  LumaChroma spread;
};

inline ColourPrediction predict_from(KnownVertices::Four known, const LumaChroma* colours) {
  const Lanes a = lanes_of(colours[known[0]]), b = lanes_of(colours[known[1]]);
  const Lanes c = lanes_of(colours[known[2]]), d = lanes_of(colours[known[3]]);
  constexpr Lanes kHalf{2, 2, 2, 2};
  const Lanes low = min_of(min_of(a, b), min_of(c, d));
  const Lanes high = max_of(max_of(a, b), max_of(c, d));
  return {(a + b + c + d + kHalf) >> 2, colour_in(high - low)};
}

inline constexpr LumaChroma kMinColour{0, -255, -255, 0}, kMaxColour{255, 255, 255, 0};
inline constexpr LumaChroma kFirstColour{128, 0, 0, 0};  ///< prediction of the first vertex

inline LumaChroma clamped(Lanes colour) {
  return colour_in(min_of(max_of(colour, lanes_of(kMinColour)), lanes_of(kMaxColour)));
}
/// Number `n` of a colour: prediction plus residual, clamped to its range.
inline int16_t dequantised(int prediction, int residual, int step, int n) {
  const int64_t value = prediction + int64_t{residual} * step;
  return static_cast<int16_t>(std::clamp<int64_t>(value, kMinColour[n], kMaxColour[n]));
}

/// A symbol encodes the residuals of a vertex: up to 7 steps either way for luma, one step for Co
/// and Cg. A larger residual has the escape value, one above that range, and is coded separately.
struct ColourSymbol {
  static constexpr std::array<int, 3> kReach{7, 1, 1};
  static constexpr std::array<uint32_t, 3> kShift{4, 2, 0};

  static uint32_t of(const std::array<int, 3>& residuals) {
    uint32_t symbol = 0;
    for (int n = 0; n < 3; ++n) {
      const bool escape = is_escape(residuals[n], n);
      symbol |= static_cast<uint32_t>(escape ? 2 * kReach[n] + 1 : residuals[n] + kReach[n])
                << kShift[n];
    }
    return symbol;
  }
  /// Residual `n` of a symbol; kReach[n] + 1 for an escape.
  static int residual(uint32_t symbol, int n) {
    const uint32_t mask = n == 0 ? 15 : 3;
    return static_cast<int>(symbol >> kShift[n] & mask) - kReach[n];
  }
  static bool is_escape(int residual, int n) { return std::abs(residual) > kReach[n]; }
};

/// Selects the table of a symbol by the spread of the known colours, which predicts the size of the
/// residual. The last table is for vertices predicted from the previous frame.
class ColourContexts {
 public:
  static constexpr int kChroma = 3;
  static constexpr int kPrevious = kSpreadClasses * kChroma;
  static constexpr int kCount = kPrevious + 1;

  explicit ColourContexts(const ColourSteps& steps) {
    for (size_t n = 0; n < 3; ++n) {
      for (int spread = 0; spread < kSpreads; ++spread) {
        const int class_index = spread_class(spread, steps[n]);
        classes_[n][spread] = static_cast<uint8_t>(n == 0 ? kChroma * class_index
                                                          : std::min(class_index, kChroma - 1));
      }
    }
  }
  uint32_t of(const LumaChroma& spread) const {
    return uint32_t{classes_[0][spread[0]]} +
           std::max(classes_[1][spread[1]], classes_[2][spread[2]]);
  }

 private:
  static constexpr int kSpreads = 512;
  std::array<std::array<uint8_t, kSpreads>, 3> classes_{};
};

/// Model of escaped residuals: those outside the range of a symbol.
class EscapeModel {
 public:
  template <class Coder>
  int code(Coder& coder, int n, int residual) {
    const bool negative = coder.even_bit(residual < 0);
    const int min_magnitude = ColourSymbol::kReach[n] + 1;
    const auto wanted = static_cast<uint32_t>(std::max(std::abs(residual) - min_magnitude, 0));
    const int magnitude = min_magnitude + static_cast<int>(excess_[n].code(coder, wanted));
    return negative ? -magnitude : magnitude;
  }

 private:
  std::array<NumberModel, 3> excess_;
};

}  // namespace v3d::codec
