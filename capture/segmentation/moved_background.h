// Suppresses foreground pieces that are displaced background, such as a carpet's edge that moved,
// or a lamp seen by a camera that sank a little.
// Source: Elgammal, Harwood, Davis: "Non-parametric Model for Background Subtraction" (ECCV 2000),
// section 4, suppression of false detections. Here it decides on whole pieces, so that a performer
// loses no pixel whose colour equals the background's.
#pragma once

#include <cstddef>
#include <cstdint>

#include "base/image/image.h"
#include "base/image/mask_components.h"
#include "capture/segmentation/background_table.h"

namespace v3d {

/// The background that an image should show.
struct ExpectedBackground {
  const BackgroundTable& table;
  uint32_t gain;        ///< brightness of the image, see brightness_ratio()
  uint32_t quad_limit;  ///< squared distance above which a quad differs, see QuadTest::limit
};

/// True if at least 60 % of a foreground piece match background at most `reach` pixels away in x
/// and in y. It tests up to 64 pixels of the piece, so the time does not depend on its area. Pure
/// function.
bool is_moved_background(const MaskComponents& pieces, size_t piece, ImageView image,
                         const ExpectedBackground& background, int reach);

}  // namespace v3d
