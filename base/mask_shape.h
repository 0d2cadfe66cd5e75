// Set operations and morphology on masks.
#pragma once

#include "base/mask.h"

namespace v3d {

/// Intersection. Requires equal sizes, like all functions of two masks here.
Mask both(Mask a, const Mask& b);
/// Set difference: pixels of `a` that are not in `b`.
Mask only_first(Mask a, const Mask& b);
/// Union.
Mask either(Mask a, const Mask& b);

/// Largest radius of the functions below, pixels.
inline constexpr int kMostRadius = 63;

/// Dilation by a square: every pixel within `radius` rows and columns of a foreground pixel.
/// Requires 0 <= radius <= kMostRadius, like the functions below.
Mask grown(const Mask& mask, int radius);
/// Erosion by a square: every pixel for which all pixels within `radius` rows and columns are
/// foreground. Pixels outside the image count as foreground.
Mask shrunk(const Mask& mask, int radius);
/// Morphological opening by a square: removes parts narrower than 2 * radius + 1 pixels.
Mask opened(const Mask& mask, int radius);

}  // namespace v3d
