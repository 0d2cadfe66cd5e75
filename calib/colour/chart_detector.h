// Colour charts with 24 patches found in pictures: the adapter of OpenCV's detector (mcc).
#pragma once

#include <array>
#include <optional>

#include "base/image.h"
#include "calib/colour/colour_fit.h"

namespace v3d::calib {

/// Mean grey values of the patches, from dark skin to black.
using ChartColours = std::array<Eigen::Vector3d, 24>;

/// The chart in one picture of linear light; empty where none is found. It wants to be whole, some
/// 150 pixels wide, and not much slanted. Any pixel format with colour.
std::optional<ChartColours> find_chart(ImageView image);

}  // namespace v3d::calib
