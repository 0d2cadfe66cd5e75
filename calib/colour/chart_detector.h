// Detection of colour charts with 24 patches: the adapter of OpenCV's detector (mcc).
#pragma once

#include <array>
#include <optional>

#include "base/image/image.h"
#include "calib/colour/colour_fit.h"

namespace v3d::calib {

/// Mean R, G, B of each patch, grey values 0 to 255 in linear light, from dark skin to black.
using ChartColours = std::array<Eigen::Vector3d, 24>;

/// The chart in one image of linear light, or nothing.
///
/// `image`: any pixel format with colour. The chart must be completely visible, at least about 150
/// px wide, and only slightly slanted.
std::optional<ChartColours> find_chart(ImageView image);

}  // namespace v3d::calib
