// How bright an image is as a whole, against an expectation of it.
#pragma once

#include <cstdint>
#include <span>

#include "base/image/image.h"

namespace v3d {

inline constexpr uint32_t kUnitGain =
    32768;  ///< brightness ratios are fixed-point numbers of 1/32768

/// The ratio of the image's samples to `mean` (per sample, 1/256 grey value) that most of them
/// agree on to a few per cent, from a regular subset: what the performer covers disagrees with
/// itself and has no say. Limited to [0.5, 1.9]. Pure.
uint32_t brightness_ratio(ImageView image, std::span<const uint16_t> mean);

}  // namespace v3d
