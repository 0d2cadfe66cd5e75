#include "recon/hull/voxel_projection.h"

#include <algorithm>
#include <cmath>

namespace v3d {
namespace {

enum { kK4 = 5, kTauX = 12 };

Lens lens_of(const CameraModel& camera) {
  if (camera.matrix()(0, 1) != 0) return Lens::kFull;
  if (!camera.has_distortion()) return Lens::kPinhole;
  const auto& d = camera.distortion();
  const bool simple = std::all_of(d.begin() + kK4, d.end(), [](double c) { return c == 0; });
  return simple ? Lens::kPolynomial : Lens::kFull;
}

bool is_small(const VoxelCamera& camera, const VoxelGrid& grid) {
  const auto max_index = static_cast<float>(*std::ranges::max_element(grid.counts));
  const auto below = [](float limit) { return [=](float v) { return std::abs(v) <= limit; }; };
  const auto& h = camera.pixel_from_lens;
  const auto& m = camera.cam_from_voxel;
  return std::all_of(camera.d.begin(), camera.d.end(), below(1e4F)) &&
         std::all_of(&h[0][0], &h[0][0] + 9, below(1e6F)) &&
         std::all_of(&m[0][0], &m[0][0] + 12, [&](float v) { return below(1e7F)(v * max_index); });
}

}  // namespace

VoxelCamera::VoxelCamera(const CameraModel& camera, const VoxelGrid& grid)
    : lens(lens_of(camera)),
      width(static_cast<float>(camera.size().width)),
      height(static_cast<float>(camera.size().height)),
      max_radius2(static_cast<float>(camera.max_radius2())) {
  const Eigen::Matrix3d axes = camera.cam_from_world().rotation * grid.voxel_m;
  const Eigen::Vector3d first = camera.cam_from_world() * grid.center(0, 0, 0);
  Eigen::Matrix3d lens_to_pixel = camera.matrix() * camera.tilt();
  lens_to_pixel.topRows<2>() += 0.5 * lens_to_pixel.row(2).replicate<2, 1>();
  for (int row = 0; row < 3; ++row) {
    for (int column = 0; column < 3; ++column) {
      cam_from_voxel[row][column] = static_cast<float>(axes(row, column));
      pixel_from_lens[row][column] = static_cast<float>(lens_to_pixel(row, column));
    }
    cam_from_voxel[row][3] = static_cast<float>(first[row]);
  }
  std::copy_n(camera.distortion().begin(), d.size(), d.begin());
  cannot_overflow = is_small(*this, grid);
}

}  // namespace v3d
