// Projection of voxels into pixels in single precision, used by the volume intersection. Lens
// model: OpenCV 4.6 calib3d, as in base/geometry/camera_model.h.
#pragma once

#include <array>

#include "base/geometry/camera_model.h"
#include "recon/hull/voxel_grid.h"

namespace v3d {

/// Which terms of the lens model a camera has; the others are skipped.
enum class Lens {
  kPinhole,
  kPolynomial,  ///< k1 k2 p1 p2 k3
  kFull,        ///< any of the 14, and skew
};

/// A camera prepared for the voxels of one grid. Immutable; any thread.
struct VoxelCamera {
  Lens lens = Lens::kPinhole;
  float width = 0;   ///< of the image, pixels
  float height = 0;  ///< of the image, pixels
  float max_radius2 = 0;
  /// Rows x, y, z: from voxel index (i, j, k, 1) to camera coordinates of its centre, metres.
  float cam_from_voxel[3][4]{};
  std::array<float, 12> d{};  ///< distortion, OpenCV's order, without the tilt
  /// Distorted normalised coordinates to pixels, tilt included, moved by half a pixel so that
  /// floor() names the pixel.
  float pixel_from_lens[3][3]{};
  /// True when no step of the projection overflows for a point at least 1 mm in front of the camera
  /// and within a radius2 of 1e6.
  bool cannot_overflow = false;

  VoxelCamera() = default;
  VoxelCamera(const CameraModel& camera, const VoxelGrid& grid);
};

/// A camera for points in metres in the world instead of voxel indices.
inline VoxelCamera camera_of_metres(const CameraModel& camera) {
  return {camera, VoxelGrid{Eigen::Vector3d::Constant(-0.5), 1, {}}};
}

inline float square(float x) { return x * x; }
inline float reciprocal(float x) { return 1.0F / x; }
inline float times(float a, float b) { return a * b; }

#include "recon/hull/voxel_projection_steps.inc"

/// The pixel that contains the projection of a voxel's centre. Within 0.02 pixels of
/// CameraModel::project() for voxels at least 0.2 m from the camera, in grids of a few metres.
struct SeenPixel {
  bool seen = false;
  int x = 0;
  int y = 0;
};

inline SeenPixel project_voxel(const VoxelCamera& c, int i, int j, int k) {
  const auto p =
      camera_point<float>(c, static_cast<float>(i), static_cast<float>(j), static_cast<float>(k));
  const PixelPoint<float> q = pixel_point(c, p);
  const bool seen = p.z > 0 && q.radius2 <= c.max_radius2 && q.u >= 0 && q.v >= 0 &&
                    q.u < c.width && q.v < c.height;
  // Truncation is floor() here, because u and v are not negative.
  return seen ? SeenPixel{true, static_cast<int>(q.u), static_cast<int>(q.v)} : SeenPixel{};
}

}  // namespace v3d
