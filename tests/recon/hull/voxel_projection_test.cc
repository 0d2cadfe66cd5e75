#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

#include "recon/hull/voxel_grid.h"
#include "tests/recon/random_rig.h"

namespace v3d::recon {
namespace {

const VoxelGrid kGrid{{-1.5, -1.5, 0}, 0.008, {375, 375, 250}};

struct Voxel {
  int i, j, k;
};

Voxel random_voxel() { return {uniform_int(0, 375), uniform_int(0, 375), uniform_int(0, 250)}; }

/// A camera of a real studio: XGA, with a lens of random_distortion() without extreme distortion.
CameraModel studio_camera() {
  CameraModel c = random_camera(box_of(kGrid));
  Eigen::Matrix3d k;
  k << uniform(500, 1500), uniform(-2, 2), uniform(480, 540), 0, uniform(500, 1500),
      uniform(360, 400), 0, 0, 1;
  Distortion d = c.distortion();
  for (double& coefficient : d) coefficient /= 3;
  return CameraModel({1024, 768}, k, d, c.cam_from_world());
}

PixelPoint<float> point_of(const VoxelCamera& camera, const Voxel& v) {
  return pixel_point(camera, camera_point<float>(camera, v.i, v.j, v.k));
}

RC_GTEST_PROP(VoxelProjection, lies_within_a_fiftieth_of_a_pixel_of_the_camera_model, ()) {
  const CameraModel model = studio_camera();
  const VoxelCamera camera(model, kGrid);
  int compared = 0;
  for (int n = 0; n < 100; ++n) {
    const Voxel v = random_voxel();
    const Eigen::Vector3d center = kGrid.center(v.i, v.j, v.k);
    const auto exact = model.project(center);
    const double z = (model.cam_from_world() * center).z();
    if (!exact || z < 0.2 || !model.inside_image(*exact)) continue;
    const PixelPoint<float> point = point_of(camera, v);
    RC_ASSERT(std::abs(point.u - 0.5 - exact->x()) < 0.02);
    RC_ASSERT(std::abs(point.v - 0.5 - exact->y()) < 0.02);
    ++compared;
  }
  RC_TAG(compared > 0 ? "seen" : "not seen");
}

RC_GTEST_PROP(VoxelProjection, sees_what_the_camera_model_sees_away_from_borders, ()) {
  const CameraModel model = studio_camera();
  const VoxelCamera camera(model, kGrid);
  for (int n = 0; n < 100; ++n) {
    const Voxel v = random_voxel();
    const Eigen::Vector3d center = kGrid.center(v.i, v.j, v.k);
    const Eigen::Vector3d p = model.cam_from_world() * center;
    if (std::abs(p.z()) < 0.2) continue;
    const double radius2 = (p.head<2>() / p.z()).squaredNorm();
    if (std::abs(radius2 - model.max_radius2()) < 1e-3 * radius2) continue;
    const auto exact = model.project(center);
    const SeenPixel pixel = project_voxel(camera, v.i, v.j, v.k);
    if (!exact) {
      RC_ASSERT(!pixel.seen);
      continue;
    }
    const Eigen::Vector2d off = (exact->array() - exact->array().round()).abs();
    if (off.maxCoeff() > 0.48) continue;  // too close to a pixel border for a decision
    RC_ASSERT(pixel.seen == model.inside_image(*exact));
    if (!pixel.seen) continue;
    RC_ASSERT(pixel.x == std::lround(exact->x()));
    RC_ASSERT(pixel.y == std::lround(exact->y()));
  }
}

}  // namespace
}  // namespace v3d::recon
