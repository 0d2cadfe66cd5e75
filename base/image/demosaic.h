// Demosaicing: converts raw sensor images to RGB, and RGB to a Bayer mosaic.
#pragma once

#include "base/image/image.h"

namespace v3d {

/// Converts an image of any format to RGB8.
/// Grey is copied to three channels. A Bayer image is demosaiced with linear filters of 5 x 5
/// pixels: measured samples stay unchanged, and the other two colours follow their detail. The
/// image is mirrored at its borders.
/// Pure function; runs in one thread.
/// Source: Malvar, He and Cutler, High-quality linear interpolation for demosaicing of
/// Bayer-patterned color images, ICASSP 2004.
Image to_rgb(ImageView source);

/// The image of a sensor with the colour filters of `format`: one of the three samples of each
/// pixel. Requires RGB8 and is_bayer(format).
Image mosaic(ImageView rgb, PixelFormat format);

}  // namespace v3d
