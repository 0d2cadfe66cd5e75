// Lattice of the reconstructed space and its projection.
#pragma once

#include <Eigen/Core>
#include <array>
#include <cstdint>

#include "base/geometry/camera_model.h"
#include "base/geometry/rigid_transform.h"
#include "base/image/mask.h"

namespace v3d::recon {

// The lattice of voxels that covers the reconstructed space.

/// Voxel (i, j, k) is the cube of edge `voxel_m` around center(i, j, k), with i along world x, j
/// along y and k along z, each from 0 to counts - 1.
struct VoxelGrid {
  Eigen::Vector3d origin = Eigen::Vector3d::Zero();  ///< lowest corner of voxel (0, 0, 0), metres
  double voxel_m = 0;                                ///< edge of a voxel, metres
  std::array<int64_t, 3> counts{};

  /// Largest number of voxels along an axis; lattice coordinates have 16 bits.
  static constexpr int64_t kMaxCount = 32767;

  /// The grid that starts at box.min and covers the box, to a millionth of a voxel. Counts saturate
  /// at 2^62; see require_memory(). Throws InputError for a voxel below 1 nm or a box without
  /// volume.
  static VoxelGrid covering(const Box& box, double voxel_m);

  Eigen::Vector3d center(int i, int j, int k) const {
    return origin + voxel_m * (Eigen::Vector3d(i, j, k) + Eigen::Vector3d::Constant(0.5));
  }
  bool contains(int i, int j, int k) const {
    return i >= 0 && j >= 0 && k >= 0 && i < counts[0] && j < counts[1] && k < counts[2];
  }
  double voxel_volume_m3() const { return voxel_m * voxel_m * voxel_m; }

  friend bool operator==(const VoxelGrid&, const VoxelGrid&) = default;
};

/// Throws InputError, with the arithmetic, when the grid at 1 bit a voxel exceeds
/// `bytes_available`, or an axis has more than kMaxCount voxels.
void require_memory(const VoxelGrid& grid, double bytes_available);

/// Throws InputError for a grid that reaches so far from the origin of the world that single
/// precision rounds positions to more than a sixteenth of a voxel: vertices would coincide, and
/// cameras would be displaced.
void require_precision(const VoxelGrid& grid);

// Projection of voxels into pixels in single precision, used by the volume intersection. Lens
// model: OpenCV 4.6 calib3d, as in base/geometry/camera_model.h.

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

// Bounds mask: the pixels of a camera that can show the reconstructed space.

/// The pixels whose rays meet `box` (world, metres), in blocks of 4 x 4 pixels: a block is set when
/// the ray of one of its corners meets the box. The mask exceeds the exact outline by at most half
/// a block.
Mask bounds_mask(const Box& box, const CameraModel& camera);

}  // namespace v3d::recon
