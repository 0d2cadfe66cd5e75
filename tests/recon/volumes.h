// Volumes for tests, defined by a rule.
#pragma once

#include <utility>
#include <vector>

#include "recon/hull/sparse_volume.h"

namespace v3d::recon {

/// All voxels of the grid for which occupied(i, j, k).
template <class Occupied>
SparseVolume make_volume(const VoxelGrid& grid, const Occupied& occupied) {
  const std::array<int, 3> bricks = SparseVolume(grid).brick_counts();
  std::vector<PlacedBrick> made;
  for (int z = 0; z < bricks[2]; ++z) {
    for (int y = 0; y < bricks[1]; ++y) {
      for (int x = 0; x < bricks[0]; ++x) made.push_back({{x, y, z}, {}});
    }
  }
  for (PlacedBrick& brick : made) {
    brick.bits = bits_inside(grid, brick.at);
    for (int n = 0; n < 512; ++n) {
      const int i = 8 * brick.at.x + n % 8;
      const int j = 8 * brick.at.y + n / 8 % 8;
      const int k = 8 * brick.at.z + n / 64;
      if (!grid.contains(i, j, k) || !occupied(i, j, k)) {
        brick.bits[n / 64] &= ~(uint64_t{1} << (n % 64));
      }
    }
  }
  const std::span<const PlacedBrick> part(made);
  return SparseVolume(grid, {&part, 1});
}

/// A grid of that many voxels of 1 cm, with a corner that is not a round number.
inline VoxelGrid small_grid(int nx, int ny, int nz) {
  return {Eigen::Vector3d(-0.137, 0.211, 0.05), 0.01, {nx, ny, nz}};
}

}  // namespace v3d::recon
