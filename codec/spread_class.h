// Class of the spread of the known values, which predicts the size of the next residual.
#pragma once

#include <algorithm>
#include <array>

namespace v3d {

inline constexpr int kSpreadClasses = 6;

/// Returns 0 when the known values agree. Requires 0 <= spread, 1 <= step.
inline int spread_class(int spread, int step) {
  constexpr std::array<int, kSpreadClasses - 1> kBounds{1, 3, 6, 10, 16};  // half steps
  const int halves = 2 * spread / step;
  return static_cast<int>(std::count_if(kBounds.begin(), kBounds.end(),
                                        [halves](int bound) { return halves >= bound; }));
}

}  // namespace v3d
