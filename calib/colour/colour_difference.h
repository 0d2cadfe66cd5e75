// How different two colours look.
#pragma once

#include <Eigen/Core>

namespace v3d::calib {

/// CIE L*a*b* of linear light, R, G, B from 0 to 1 with the primaries and the white of sRGB (D65).
Eigen::Vector3d lab_of(const Eigen::Vector3d& linear_rgb);

/// Delta E of CIE 2000 between two colours in L*a*b*: 1 is about what an eye can just tell.
/// Source: Sharma, Wu, Dalal, "The CIEDE2000 Color-Difference Formula", 2005.
double delta_e_2000(const Eigen::Vector3d& lab1, const Eigen::Vector3d& lab2);

}  // namespace v3d::calib
