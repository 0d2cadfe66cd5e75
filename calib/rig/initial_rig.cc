#include "calib/rig/initial_rig.h"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace v3d::calib {

Rig initial_rig(const std::vector<std::string>& names, ImageSize size, double horizontal_fov_deg,
                const Box& space) {
  const double half_width = 0.5 * size.width;
  const double half_height = 0.5 * size.height;
  const double focal = half_width / std::tan(horizontal_fov_deg * std::numbers::pi / 360);
  Eigen::Matrix3d matrix;
  matrix << focal, 0, half_width, 0, focal, half_height, 0, 0, 1;
  // The bounding sphere of the space touches the nearest borders of the image.
  const double narrowest = std::atan(std::min(half_width, half_height) / focal);
  const double distance = 0.5 * space.size().norm() / std::sin(narrowest);
  Rig rig;
  for (size_t i = 0; i < names.size(); ++i) {
    const double angle =
        2 * std::numbers::pi * static_cast<double>(i) / static_cast<double>(names.size());
    const Eigen::Vector3d eye =
        space.center() + distance * Eigen::Vector3d(std::cos(angle), std::sin(angle), 0);
    rig.push_back({names[i], CameraModel(size, matrix, {}, look_at(eye, space.center())), {}});
  }
  return rig;
}

}  // namespace v3d::calib
