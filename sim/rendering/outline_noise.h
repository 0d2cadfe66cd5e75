// Silhouettes with noisy outlines, as an inaccurate segmentation gives them.
#pragma once

#include <cstdint>

#include "base/image/mask.h"

namespace v3d::sim {

/// Displaces the outline by smooth noise with the standard deviation `sigma_px` along x and y.
/// Points more than 16 px apart are displaced independently. Deterministic for each `seed`.
Mask with_outline_noise(const Mask& mask, double sigma_px, uint64_t seed);

}  // namespace v3d::sim
