// Masks as sets of pixels: what two have in common, and one grown or shrunk.
#pragma once

#include "base/image/mask.h"

namespace v3d {

/// Pixels of both. Requires equal sizes, here and below.
Mask intersection_of(Mask a, const Mask& b);
/// Pixels of `a` that `b` has not.
Mask difference_of(Mask a, const Mask& b);
/// Pixels of either.
Mask union_of(Mask a, const Mask& b);

inline constexpr int kMaxRadius = 63;

/// Every pixel within `radius` rows and columns of a foreground pixel. 0 <= radius <= kMaxRadius,
/// here and below.
Mask dilate(const Mask& mask, int radius);
/// Every pixel of which all pixels within `radius` rows and columns are foreground; what lies
/// outside the image counts as foreground.
Mask erode(const Mask& mask, int radius);
/// Without what is narrower than 2 * radius + 1 pixels (morphological opening by a square).
Mask open(const Mask& mask, int radius);

}  // namespace v3d
