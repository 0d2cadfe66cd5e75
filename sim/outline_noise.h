// Silhouettes as a worse segmentation would make them: their outlines tremble.
#pragma once

#include <cstdint>

#include "base/mask.h"

namespace v3d::sim {

/// Every outline is shifted to and fro along itself, by `sigma_px` (standard deviation) in either
/// direction of the image; places farther apart than 16 pixels are shifted independently. The same
/// seed gives the same shifts.
Mask with_outline_noise(const Mask& mask, double sigma_px, uint64_t seed);

}  // namespace v3d::sim
