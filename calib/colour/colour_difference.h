// Perceptual colour difference (CIEDE2000).
#pragma once

#include <Eigen/Core>

namespace v3d::calib {

/// CIE L*a*b* of linear R, G, B from 0 to 1, with the primaries and white point of sRGB (D65).
Eigen::Vector3d lab_of(const Eigen::Vector3d& linear_rgb);

/// The CIEDE2000 difference of two colours in L*a*b*. About 1 is just noticeable.
/// Source: Sharma, Wu, Dalal, "The CIEDE2000 Color-Difference Formula", 2005.
double delta_e_2000(const Eigen::Vector3d& lab1, const Eigen::Vector3d& lab2);

}  // namespace v3d::calib
