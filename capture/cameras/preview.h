// Preview images and masks at half resolution.
#pragma once

#include "base/image/image.h"
#include "base/image/mask.h"

namespace v3d {

/// RGB8 image of half the width and height: every 2x2 quad, which in a Bayer image holds all
/// colours, becomes one pixel. A last odd row or column is left out.
/// Requires at least 2x2 pixels. Pure function.
Image preview_of(ImageView raw);

/// Mask of half the width and height: foreground where any pixel of the 2x2 quad is. Pure function.
Mask preview_mask(const Mask& mask);

}  // namespace v3d
