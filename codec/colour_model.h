// How colours are predicted, and what of the difference a symbol tells: encoder and decoder agree
// on this. docs/compact-frame.md is normative.
#pragma once

#include <algorithm>
#include <array>
#include <bit>
#include <cstdint>
#include <cstdlib>

#include "codec/colour.h"
#include "codec/known_vertices.h"
#include "codec/range_coder.h"
#include "codec/spread_class.h"

namespace v3d {

/// So many vertices are predicted alike.
inline constexpr uint32_t kColourGroup = 64;

/// The four numbers of a colour in a register, as GCC and Clang have it: what they make of loops
/// over an array of 16-bit numbers takes twice as long.
using Lanes [[gnu::vector_size(8)]] = int16_t;
inline Lanes lanes_of(const LumaChroma& colour) { return std::bit_cast<Lanes>(colour); }
inline LumaChroma colour_in(Lanes lanes) { return std::bit_cast<LumaChroma>(lanes); }
inline Lanes least_of(Lanes a, Lanes b) { return a < b ? a : b; }
inline Lanes most_of(Lanes a, Lanes b) { return a > b ? a : b; }

/// Prediction of one vertex, and how much that differs what it comes from.
struct ColourGuess {
  Lanes mean;
  LumaChroma spread;
};

inline ColourGuess guess_from(KnownVertices::Four known, const LumaChroma* colours) {
  const Lanes a = lanes_of(colours[known[0]]), b = lanes_of(colours[known[1]]);
  const Lanes c = lanes_of(colours[known[2]]), d = lanes_of(colours[known[3]]);
  constexpr Lanes kHalf{2, 2, 2, 2};
  const Lanes least = least_of(least_of(a, b), least_of(c, d));
  const Lanes most = most_of(most_of(a, b), most_of(c, d));
  return {(a + b + c + d + kHalf) >> 2, colour_in(most - least)};
}

inline constexpr LumaChroma kLeastColour{0, -255, -255, 0}, kMostColour{255, 255, 255, 0};
inline constexpr LumaChroma kFirstColour{128, 0, 0, 0};  ///< predicted where nothing is known

inline LumaChroma clamped(Lanes colour) {
  return colour_in(least_of(most_of(colour, lanes_of(kLeastColour)), lanes_of(kMostColour)));
}
/// Number `n` of a colour: so many steps from where it was guessed.
inline int16_t stepped(int guess, int residual, int step, int n) {
  const int64_t value = guess + int64_t{residual} * step;
  return static_cast<int16_t>(std::clamp<int64_t>(value, kLeastColour[n], kMostColour[n]));
}

/// A symbol tells a residual of luma of up to 7 steps either way, and residuals of Co and Cg of one
/// step; one more stands for all beyond.
struct ColourSymbol {
  static constexpr std::array<int, 3> kReach{7, 1, 1};
  static constexpr std::array<uint32_t, 3> kShift{4, 2, 0};

  static uint32_t of(const std::array<int, 3>& residuals) {
    uint32_t symbol = 0;
    for (int n = 0; n < 3; ++n) {
      const bool beyond = is_beyond(residuals[n], n);
      symbol |= static_cast<uint32_t>(beyond ? 2 * kReach[n] + 1 : residuals[n] + kReach[n])
                << kShift[n];
    }
    return symbol;
  }
  /// kReach[n] + 1 for what is beyond.
  static int residual(uint32_t symbol, int n) {
    const uint32_t mask = n == 0 ? 15 : 3;
    return static_cast<int>(symbol >> kShift[n] & mask) - kReach[n];
  }
  static bool is_beyond(int residual, int n) { return std::abs(residual) > kReach[n]; }
};

/// Which of the tables a symbol comes from: by what the spread of the known colours tells of the
/// residual. The last is that of vertices predicted from the frame before.
class ColourContexts {
 public:
  static constexpr int kChroma = 3;
  static constexpr int kFormer = kSpreadClasses * kChroma;
  static constexpr int kCount = kFormer + 1;

  explicit ColourContexts(const ColourSteps& steps) {
    for (size_t n = 0; n < 3; ++n) {
      for (int spread = 0; spread < kSpreads; ++spread) {
        const int its_class = spread_class(spread, steps[n]);
        classes_[n][spread] =
            static_cast<uint8_t>(n == 0 ? kChroma * its_class : std::min(its_class, kChroma - 1));
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

/// Residuals that are beyond what a symbol tells.
class BeyondModel {
 public:
  template <class Coder>
  int code(Coder& coder, int n, int residual) {
    const bool negative = coder.even_bit(residual < 0);
    const int least = ColourSymbol::kReach[n] + 1;
    const auto wanted = static_cast<uint32_t>(std::max(std::abs(residual) - least, 0));
    const int magnitude = least + static_cast<int>(rest_[n].code(coder, wanted));
    return negative ? -magnitude : magnitude;
  }

 private:
  std::array<NumberModel, 3> rest_;
};

}  // namespace v3d
