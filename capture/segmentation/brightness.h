// Brightness ratio of an image to its background model.
#pragma once

#include <cstdint>
#include <span>

#include "base/image/image.h"

namespace v3d {

inline constexpr uint32_t kUnitGain =
    32768;  ///< brightness ratios are fixed-point numbers of 1/32768

/// Mode of the ratios of the image's samples to `mean` (per sample, 1/256 grey value), in units of
/// 1 / kUnitGain, limited to [0.5, 1.9]. It uses a regular subset of the samples. Samples of the
/// performer have scattered ratios and do not change the mode. kUnitGain if there are too few
/// usable samples. Pure function.
uint32_t brightness_ratio(ImageView image, std::span<const uint16_t> mean);

}  // namespace v3d
