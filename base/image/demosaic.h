// From the colour filter mosaic of a sensor to whole colours, and back.
#pragma once

#include "base/image/image.h"

namespace v3d {

/// RGB from any format: grey is copied to three channels, a Bayer image is demosaiced with the
/// linear filters of 5 x 5 pixels of Malvar, He and Cutler (High-quality linear interpolation for
/// demosaicing of Bayer-patterned color images, ICASSP 2004): what the sensor measured stays, and
/// the other two colours follow its detail. The image is mirrored at its borders. Pure; one thread.
Image to_rgb(ImageView source);

/// The image that a sensor behind the filters of `format` would have given: one of the three
/// samples of every pixel. Requires RGB8, and is_bayer(format).
Image mosaic(ImageView rgb, PixelFormat format);

}  // namespace v3d
