// Background that is not where it was: a lamp seen by a camera that sank a little, a carpet's edge
// that someone walked on.
// Source: Elgammal, Harwood, Davis: "Non-parametric Model for Background Subtraction" (ECCV 2000),
// section 4, suppression of false detections; here by whole pieces, so that a performer loses no
// pixel where his colour happens to be the background's.
#pragma once

#include <cstdint>
#include <span>

#include "base/image.h"
#include "base/mask.h"

namespace v3d {

/// The background in the segmenter's fixed point, per sample.
struct ExpectedBackground {
  std::span<const uint16_t> mean;       ///< 1/256 grey value
  std::span<const uint16_t> sharpness;  ///< 4096 / spread
  uint32_t gain;                        ///< of the image's brightness, see brightness_ratio()
  uint32_t quad_limit;  ///< squared distance beyond which a quad differs, in (1/8 spread)^2
};

/// Clears the connected pieces (eight neighbours) of `mask` that show little else than background
/// from no more than `reach` pixels away, in x and in y. Pure; looks at a sample of each piece, so
/// the time does not grow with its area.
void drop_moved_background(Mask& mask, ImageView image, const ExpectedBackground& background,
                           int reach);

}  // namespace v3d
