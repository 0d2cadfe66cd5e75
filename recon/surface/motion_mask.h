// Whether something moved between two pictures of one camera.
#pragma once

#include "recon/visibility/surface_camera.h"

namespace v3d {

/// 1 where nothing moved between two pulses round a pixel of the camera, 0 where something did: by
/// the brightness of 3 x 3 pixels at half resolution, which differs by no more than noise or
/// plainly, and by the silhouette then, which the pixel has left. 0 beyond the border of a picture.
float static_weight(const SurfaceCamera& now, const SurfaceCamera& then,
                    const Eigen::Vector2f& pixel);

}  // namespace v3d
