// Small pictures for people.
#pragma once

#include "base/image/image.h"
#include "base/image/mask.h"

namespace v3d {

/// RGB8 of half the width and height: every 2x2 quad becomes one pixel, which in a Bayer image
/// holds every colour. A last odd row or column is left out. Requires at least 2x2 pixels. Pure.
Image preview_of(ImageView raw);

/// The same of a silhouette: foreground where any pixel of the quad is. Pure.
Mask preview_mask(const Mask& mask);

}  // namespace v3d
