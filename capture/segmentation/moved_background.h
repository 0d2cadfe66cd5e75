// Background that is not where it was: a lamp seen by a camera that sank a little, a carpet's edge
// that someone walked on.
// Source: Elgammal, Harwood, Davis: "Non-parametric Model for Background Subtraction" (ECCV 2000),
// section 4, suppression of false detections; here by whole pieces, so that a performer loses no
// pixel where his colour happens to be the background's.
#pragma once

#include <cstddef>
#include <cstdint>

#include "base/image/image.h"
#include "base/image/mask_components.h"
#include "capture/segmentation/background_table.h"

namespace v3d {

/// What an image should show.
struct ExpectedBackground {
  const BackgroundTable& table;
  uint32_t gain;        ///< of the image's brightness, see brightness_ratio()
  uint32_t quad_limit;  ///< squared distance beyond which a quad differs, see QuadTest
};

/// Whether a piece of foreground shows little else than background from no more than `reach` pixels
/// away, in x and in y. Pure; looks at a sample of the piece, so the time does not grow with its
/// area.
bool is_moved_background(const MaskComponents& pieces, size_t piece, ImageView image,
                         const ExpectedBackground& background, int reach);

}  // namespace v3d
