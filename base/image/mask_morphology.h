// Set operations and morphology on masks.
#pragma once

#include "base/image/mask.h"

namespace v3d {

/// Intersection. Requires equal sizes, like all functions of two masks here.
Mask intersection_of(Mask a, const Mask& b);
/// Set difference: pixels of `a` that are not in `b`.
Mask difference_of(Mask a, const Mask& b);
/// Union.
Mask union_of(Mask a, const Mask& b);

/// Largest radius of the functions below, pixels.
inline constexpr int kMaxRadius = 63;

/// Dilation by a square: every pixel within `radius` rows and columns of a foreground pixel.
/// Requires 0 <= radius <= kMaxRadius, like the functions below.
Mask dilate(const Mask& mask, int radius);
/// Erosion by a square: every pixel for which all pixels within `radius` rows and columns are
/// foreground. Pixels outside the image count as foreground.
Mask erode(const Mask& mask, int radius);
/// Morphological opening by a square: removes parts narrower than 2 * radius + 1 pixels.
Mask open(const Mask& mask, int radius);

}  // namespace v3d
