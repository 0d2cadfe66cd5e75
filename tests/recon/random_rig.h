// Random rigs and silhouettes, and a reference intersection, for tests.
#pragma once

#include <rapidcheck.h>

#include <cmath>
#include <vector>

#include "base/geometry/camera_model.h"
#include "base/geometry/rigid_transform.h"
#include "base/image/mask.h"
#include "recon/hull/intersect.h"
#include "tests/recon/volumes.h"

namespace v3d::recon {

/// Uniform in [low, high), whatever RapidCheck's size is.
inline int uniform_int(int low, int high) {
  return *rc::gen::resize(rc::kNominalSize, rc::gen::inRange(low, high));
}

/// Uniform in [low, high], in steps that RapidCheck can shrink.
inline double uniform(double low, double high) {
  return low + (high - low) * uniform_int(0, 10001) / 10000.0;
}

inline Eigen::Vector3d random_point(const Box& box) {
  const Eigen::Vector3d at(uniform(0, 1), uniform(0, 1), uniform(0, 1));
  return box.min + at.cwiseProduct(box.size());
}

/// The first 0, 4, 5, 8, 12 or 14 coefficients of a real lens, sometimes of one with far stronger
/// distortion.
inline Distortion random_distortion() {
  constexpr double kUsual[14] = {0.4,  0.3,  0.01, 0.01, 0.2,  0.2,  0.1,
                                 0.05, 0.01, 0.01, 0.01, 0.01, 0.05, 0.05};
  const int length = *rc::gen::element(0, 4, 5, 8, 12, 14);
  const double strength = *rc::gen::element(0.2, 1.0, 3.0);
  Distortion d{};
  for (int n = 0; n < length; ++n) d[n] = strength * uniform(-kUsual[n], kUsual[n]);
  return d;
}

/// A camera around or inside the box, directed at it, past it or away from it.
inline CameraModel random_camera(const Box& box) {
  const Box far{box.center() - 3 * box.size(), box.center() + 3 * box.size()};
  const Eigen::Vector3d eye = random_point(*rc::gen::element(0, 0, 0, 1) == 0 ? far : box);
  const Eigen::Vector3d target = random_point(*rc::gen::element(0, 0, 0, 1) == 0 ? box : far);
  const ImageSize size{uniform_int(1, 200), uniform_int(1, 150)};
  const double focal = uniform(20, 400);
  Eigen::Matrix3d k;
  k << focal, uniform(-2, 2), 0.5 * size.width + uniform(-20, 20),  //
      0, focal * uniform(0.9, 1.1), 0.5 * size.height + uniform(-20, 20), 0, 0, 1;
  const RigidTransform upright = look_at(eye, target + Eigen::Vector3d(1e-3, 2e-3, 0));
  const RigidTransform roll = RigidTransform::from_rodrigues({0, 0, uniform(-3, 3)}, {0, 0, 0});
  return CameraModel(size, k, random_distortion(), roll * upright);
}

/// Discs, large enough to cross the border, or nothing, or everything.
inline Mask random_mask(ImageSize size) {
  Mask mask(size);
  const int discs = uniform_int(0, 4);
  const bool inverted = *rc::gen::arbitrary<bool>();
  struct Disc {
    double x, y, radius;
  };
  std::vector<Disc> all;
  for (int n = 0; n < discs; ++n) {
    all.push_back({uniform(-20, size.width + 20), uniform(-20, size.height + 20),
                   uniform(1, inverted ? 40 : 200)});
  }
  for (int y = 0; y < size.height; ++y) {
    for (int x = 0; x < size.width; ++x) {
      bool inside = false;
      for (const Disc& d : all) inside |= std::hypot(x - d.x, y - d.y) < d.radius;
      mask.set(x, y, inside != inverted);
    }
  }
  return mask;
}

/// Reference by the definition in recon/hull/intersect.h, voxel by voxel.
inline SparseVolume intersect_brute_force(const VoxelGrid& grid,
                                          const std::vector<CameraModel>& cameras,
                                          const std::vector<const Mask*>& masks, int min_views) {
  std::vector<VoxelCamera> prepared;
  for (const CameraModel& camera : cameras) prepared.emplace_back(camera, grid);
  return make_volume(grid, [&](int i, int j, int k) {
    int views = 0;
    for (size_t c = 0; c < prepared.size(); ++c) {
      if (masks[c] == nullptr) continue;
      const SeenPixel pixel = project_voxel(prepared[c], i, j, k);
      if (!pixel.seen) continue;
      if (!masks[c]->get(pixel.x, pixel.y)) return false;
      ++views;
    }
    return views >= min_views;
  });
}

inline Box box_of(const VoxelGrid& grid) {
  const Eigen::Vector3d counts(grid.counts[0], grid.counts[1], grid.counts[2]);
  return {grid.origin, grid.origin + grid.voxel_m * counts};
}

}  // namespace v3d::recon
