// Motion mask: where the image of one camera did not change between two pulses.
#pragma once

#include "recon/visibility/surface_camera.h"

namespace v3d {

/// 1 where the image around `pixel` did not change between the two pulses, 0 where it clearly
/// changed, and a ramp between them.
///
/// Compares the brightness of 3 x 3 pixels at half resolution. 0 beyond the border of an image, and
/// where the silhouette at `then` is not near the pixel.
float static_weight(const SurfaceCamera& now, const SurfaceCamera& then,
                    const Eigen::Vector2f& pixel);

}  // namespace v3d
