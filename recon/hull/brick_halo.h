// A brick's voxels and those around it, for filters of a volume that look one voxel far.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

#include "recon/hull/sparse_volume.h"

namespace v3d {

/// The numbers of a brick and of those around it: [9 (z + 1) + 3 (y + 1) + x + 1] is the one that
/// many bricks away; -1 where none is stored.
using BricksAround = std::array<int, 27>;

inline BricksAround bricks_around(const SparseVolume& volume, size_t brick) {
  const BrickCoord at = volume.coords()[brick];
  BricksAround around{};
  for (int n = 0; n < 27; ++n) {
    around[n] = volume.index_of({at.x + n % 3 - 1, at.y + n / 3 % 3 - 1, at.z + n / 9 - 1});
  }
  return around;
}

/// A number for each of the eight voxels of a row along x.
template <class Number>
using BrickRow = std::array<Number, kBrickEdge>;

/// Sums of a number over the 27 voxels in and round each voxel of a brick, x fastest.
/// row_of(brick, row) is a BrickRow of row 8 z + y; all are 0 where no brick is stored.
template <class Sum, class RowOf>
std::array<Sum, 512> neighbourhood_sums(const BricksAround& around, const RowOf& row_of) {
  constexpr int kWide = kBrickEdge + 2;
  // Of the brick and one voxel around it, along one axis after the other.
  std::array<Sum, kWide * kWide * kBrickEdge> along_x{};
  const auto brick_of = [](int i) { return i == 0 ? 0 : i > kBrickEdge ? 2 : 1; };
  Sum* to = along_x.data();
  for (int z = 0; z < kWide; ++z) {
    for (int y = 0; y < kWide; ++y, to += kBrickEdge) {
      const int* bricks = &around[9 * brick_of(z) + 3 * brick_of(y)];
      const int row = 8 * ((z + 7) % 8) + (y + 7) % 8;
      std::array<Sum, kWide> wide{};
      if (bricks[0] >= 0) wide.front() = row_of(bricks[0], row)[kBrickEdge - 1];
      if (bricks[2] >= 0) wide.back() = row_of(bricks[2], row)[0];
      if (bricks[1] >= 0) {
        const auto middle = row_of(bricks[1], row);
        for (int x = 0; x < kBrickEdge; ++x) wide[x + 1] = middle[x];
      }
      for (int x = 0; x < kBrickEdge; ++x) to[x] = wide[x] + wide[x + 1] + wide[x + 2];
    }
  }
  constexpr int kLayer = kWide * kBrickEdge;
  std::array<Sum, 512> sums{};
  for (int z = 0; z < kBrickEdge; ++z) {
    std::array<Sum, kLayer> along_z;
    const Sum* from = &along_x[z * kLayer];
    for (int i = 0; i < kLayer; ++i) along_z[i] = from[i] + from[i + kLayer] + from[i + 2 * kLayer];
    for (int i = 0; i < 64; ++i) {
      sums[64 * z + i] = along_z[i] + along_z[i + kBrickEdge] + along_z[i + 2 * kBrickEdge];
    }
  }
  return sums;
}

}  // namespace v3d
