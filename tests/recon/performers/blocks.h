// Volumes made of blocks, for tests.
#pragma once

#include <Eigen/Geometry>
#include <cmath>
#include <map>
#include <tuple>
#include <vector>

#include "recon/hull/sparse_volume.h"
#include "recon/performers/performer_labels.h"

namespace v3d::recon {

/// World frame, metres.
using Block = Eigen::AlignedBox3d;

/// Voxels of 2 cm in a space of 3 x 1.6 x 2 m.
inline VoxelGrid block_grid() {
  return VoxelGrid::covering({{-1.5, -0.8, 0}, {1.5, 0.8, 2}}, 0.02);
}

/// The voxels whose centres lie in one of the blocks.
inline SparseVolume volume_of(const std::vector<Block>& blocks) {
  const VoxelGrid grid = block_grid();
  std::map<std::tuple<int, int, int>, codec::Brick> bricks;
  for (const Block& block : blocks) {
    std::array<int, 3> first{}, end{};
    for (int a = 0; a < 3; ++a) {
      const auto voxel = [&](double coordinate) {
        const double at = std::ceil((coordinate - grid.origin[a]) / grid.voxel_m - 0.5 - 1e-9);
        return static_cast<int>(std::clamp(at, 0.0, static_cast<double>(grid.counts[a])));
      };
      first[a] = voxel(block.min()[a]);
      end[a] = voxel(block.max()[a]);
    }
    for (int k = first[2]; k < end[2]; ++k) {
      for (int j = first[1]; j < end[1]; ++j) {
        for (int i = first[0]; i < end[0]; ++i) {
          bricks[{k / 8, j / 8, i / 8}][k % 8] |= uint64_t{1} << (8 * (j % 8) + i % 8);
        }
      }
    }
  }
  std::vector<PlacedBrick> placed;
  for (const auto& [at, bits] : bricks) {
    placed.push_back({{std::get<2>(at), std::get<1>(at), std::get<0>(at)}, bits});
  }
  const std::span<const PlacedBrick> part(placed);
  return SparseVolume(grid, {&part, 1});
}

/// A body of 0.3 x 0.4 x 1.7 m around x and y, 0.2 cubic metres.
inline Block body_at(double x, double y = 0) {
  return {Eigen::Vector3d(x - 0.15, y - 0.2, 0), Eigen::Vector3d(x + 0.15, y + 0.2, 1.7)};
}

/// A rod of 6 x 6 cm along x at y and z.
inline Block rod(double x0, double x1, double y = 0, double z = 1.2) {
  return {Eigen::Vector3d(x0, y - 0.03, z - 0.03), Eigen::Vector3d(x1, y + 0.03, z + 0.03)};
}

/// The identity at a position; 0: none, -1: not occupied.
inline int identity_at(const SparseVolume& volume, const std::vector<PerformerVoxels>& performers,
                       const Eigen::Vector3d& position) {
  const Eigen::Vector3i v = ((position - volume.grid().origin) / volume.grid().voxel_m)
                                .array()
                                .floor()
                                .matrix()
                                .cast<int>();
  if (!volume.get(v.x(), v.y(), v.z())) return -1;
  const int brick = volume.index_of({v.x() / 8, v.y() / 8, v.z() / 8});
  for (const PerformerVoxels& performer : performers) {
    if ((performer.voxels[brick][v.z() % 8] >> (8 * (v.y() % 8) + v.x() % 8) & 1) != 0)
      return performer.identity;
  }
  return 0;
}

}  // namespace v3d::recon
