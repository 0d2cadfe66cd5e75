// The lattice of voxels that covers the reconstructed space.
#pragma once

#include <Eigen/Core>
#include <array>
#include <cstdint>

#include "base/geometry/box.h"

namespace v3d {

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

}  // namespace v3d
