// A brick's voxels and those around it, for filters of a volume that look one voxel far.
#pragma once

#include <array>
#include <cstddef>

#include "recon/sparse_volume.h"

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

/// Sums of a value over the 27 voxels in and round each voxel of a brick, x fastest.
/// value(brick, voxel) is that of voxel 64 z + 8 y + x; 0 where no brick is stored.
template <class Sum, class Value>
std::array<Sum, 512> sums_of_27(const BricksAround& around, const Value& value) {
  constexpr int kWide = kBrickEdge + 2;
  // Along one axis after the other; `wide` is of all voxels, the others lose the border.
  std::array<Sum, kWide * kWide * kWide> wide{};
  const auto brick_of = [](int i) { return i == 0 ? 0 : i > kBrickEdge ? 2 : 1; };
  for (int z = 0, to = 0; z < kWide; ++z) {
    for (int y = 0; y < kWide; ++y) {
      const int row = 9 * brick_of(z) + 3 * brick_of(y);
      const int voxel = 64 * ((z + 7) % 8) + 8 * ((y + 7) % 8);
      for (int x = 0; x < kWide; ++x, ++to) {
        const int brick = around[row + brick_of(x)];
        if (brick >= 0) wide[to] = value(static_cast<size_t>(brick), voxel + (x + 7) % 8);
      }
    }
  }
  std::array<Sum, kWide * kWide * kBrickEdge> flat{};
  constexpr int kLayer = kWide * kWide;
  for (size_t i = 0; i < flat.size(); ++i)
    flat[i] = wide[i] + wide[i + kLayer] + wide[i + 2 * kLayer];
  std::array<Sum, 512> sums{};
  for (int z = 0, to = 0; z < kBrickEdge; ++z) {
    for (int y = 0; y < kBrickEdge; ++y) {
      const Sum* row = &flat[z * kLayer + y * kWide];
      std::array<Sum, kWide> columns;
      for (int x = 0; x < kWide; ++x) columns[x] = row[x] + row[x + kWide] + row[x + 2 * kWide];
      for (int x = 0; x < kBrickEdge; ++x, ++to)
        sums[to] = columns[x] + columns[x + 1] + columns[x + 2];
    }
  }
  return sums;
}

}  // namespace v3d
