// From a voxel to a pixel in single precision: the one projection of the volume intersection.
// Lens model: OpenCV 4.6 calib3d, as in base/camera_model.h.
#pragma once

#include <array>

#include "base/camera_model.h"
#include "recon/voxel_grid.h"

namespace v3d {

/// Which terms of the lens model a camera has; the others are skipped.
enum class Lens {
  kPinhole,
  kPolynomial,  ///< k1 k2 p1 p2 k3
  kFull,        ///< any of the 14
};

/// A camera prepared for the voxels of one grid. Immutable; safe to use from any thread.
struct VoxelCamera {
  Lens lens = Lens::kPinhole;
  float width = 0;   ///< of the image, pixels
  float height = 0;  ///< of the image, pixels
  float max_radius2 = 0;
  /// Rows x, y, z: voxel index (i, j, k, 1) of a voxel's centre to camera coordinates, metres.
  float cam_from_voxel[3][4]{};
  std::array<float, 12> d{};  ///< distortion, OpenCV's order, without the tilt
  /// Distorted normalised coordinates to pixels, tilt included, moved by half a pixel so that
  /// floor() names the pixel.
  float pixel_from_lens[3][3]{};

  VoxelCamera() = default;
  VoxelCamera(const CameraModel& camera, const VoxelGrid& grid);
};

/// Camera coordinates of a voxel centre, metres.
template <class Real>
struct CameraPoint {
  Real x, y, z;
};

/// Where a point in front of the camera appears.
template <class Real>
struct PixelPoint {
  Real radius2;  ///< undistorted normalised x^2 + y^2; beyond max_radius2 nothing is seen
  Real u, v;     ///< pixel (floor(u), floor(v)); the first pixel's centre is (0.5, 0.5)
};

// `Real` is float, or anything that does with its operators +, *, square() and reciprocal() what
// float does: lanes of a vector register, or an Interval, which bounds all that float can give. The
// order of operations is part of the contract: the compiler may not change it, and all kinds of
// Real give one result, to the bit.

inline float square(float x) { return x * x; }
inline float reciprocal(float x) { return 1.0F / x; }

template <class Real>
CameraPoint<Real> camera_point(const VoxelCamera& c, Real i, Real j, Real k) {
  const auto row = [&](const float(&m)[4]) {
    return m[0] * i + (m[1] * j + (m[2] * k + Real(m[3])));
  };
  return {row(c.cam_from_voxel[0]), row(c.cam_from_voxel[1]), row(c.cam_from_voxel[2])};
}

/// Requires z > 0 for a meaningful result. `kLens` is c.lens.
template <Lens kLens, class Real>
PixelPoint<Real> pixel_point(const VoxelCamera& c, const CameraPoint<Real>& p) {
  const auto& h = c.pixel_from_lens;
  const Real inverse_z = reciprocal(p.z);
  Real x = p.x * inverse_z;
  Real y = p.y * inverse_z;
  const Real xx = square(x);
  const Real yy = square(y);
  const Real r2 = xx + yy;
  if constexpr (kLens != Lens::kPinhole) {
    const auto& [k1, k2, p1, p2, k3, k4, k5, k6, s1, s2, s3, s4] = c.d;
    Real radial = r2 * (r2 * (k3 * r2 + Real(k2)) + Real(k1)) + Real(1.0F);
    if constexpr (kLens == Lens::kFull) {
      const Real bottom = r2 * (r2 * (k6 * r2 + Real(k5)) + Real(k4)) + Real(1.0F);
      radial = radial * reciprocal(bottom);
    }
    const Real xy2 = 2.0F * (x * y);
    Real bent_x = x * radial + (p1 * xy2 + p2 * (2.0F * xx + r2));
    Real bent_y = y * radial + (p1 * (2.0F * yy + r2) + p2 * xy2);
    if constexpr (kLens == Lens::kFull) {
      bent_x = bent_x + r2 * (s2 * r2 + Real(s1));
      bent_y = bent_y + r2 * (s4 * r2 + Real(s3));
    }
    x = bent_x;
    y = bent_y;
  }
  Real u = h[0][0] * x + (h[0][1] * y + Real(h[0][2]));
  if constexpr (kLens != Lens::kFull) {
    return {r2, u, h[1][1] * y + Real(h[1][2])};
  } else {
    const Real v = h[1][0] * x + (h[1][1] * y + Real(h[1][2]));
    const Real inverse_w = reciprocal(h[2][0] * x + (h[2][1] * y + Real(h[2][2])));
    return {r2, u * inverse_w, v * inverse_w};
  }
}

template <class Real>
PixelPoint<Real> pixel_point(const VoxelCamera& c, const CameraPoint<Real>& p) {
  switch (c.lens) {
    case Lens::kPinhole:
      return pixel_point<Lens::kPinhole>(c, p);
    case Lens::kPolynomial:
      return pixel_point<Lens::kPolynomial>(c, p);
    default:
      return pixel_point<Lens::kFull>(c, p);
  }
}

/// The pixel in which a camera sees a voxel's centre. Lies within 0.02 pixels of
/// CameraModel::project() for voxels from 0.2 m before a camera, in grids of a few metres.
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
