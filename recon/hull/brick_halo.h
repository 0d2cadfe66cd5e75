// Filters of a volume over the 27 voxels in and around each voxel, one brick of 8 x 8 x 8 voxels at
// a time. A halo is the ring of voxels around a brick.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

#include "recon/hull/sparse_volume.h"

namespace v3d::recon {

/// Indices of a brick and of its 26 neighbours, in the order 9 (z + 1) + 3 (y + 1) + x + 1; -1
/// where no brick is stored.
using BricksAround = std::array<int, 27>;

inline BricksAround bricks_around(const SparseVolume& volume, size_t brick) {
  const codec::BrickCoord at = volume.coords()[brick];
  BricksAround around{};
  for (int n = 0; n < 27; ++n) {
    around[n] = volume.index_of({at.x + n % 3 - 1, at.y + n / 3 % 3 - 1, at.z + n / 9 - 1});
  }
  return around;
}

/// One number for each of the eight voxels of a row along x.
template <class Number>
using BrickRow = std::array<Number, codec::kBrickEdge>;

/// Sums over the 27 voxels in and around each voxel of a brick, x fastest. row_of(brick, row) is
/// the BrickRow of row 8 z + y; rows of bricks that are not stored count as 0.
template <class Sum, class RowOf>
std::array<Sum, 512> neighbourhood_sums(const BricksAround& around, const RowOf& row_of) {
  constexpr int kWide = codec::kBrickEdge + 2;
  // Partial sums along x, for the brick and one voxel around it along y and z.
  std::array<Sum, kWide * kWide * codec::kBrickEdge> along_x{};
  const auto brick_of = [](int i) { return i == 0 ? 0 : i > codec::kBrickEdge ? 2 : 1; };
  Sum* to = along_x.data();
  for (int z = 0; z < kWide; ++z) {
    for (int y = 0; y < kWide; ++y, to += codec::kBrickEdge) {
      const int* bricks = &around[9 * brick_of(z) + 3 * brick_of(y)];
      const int row = 8 * ((z + 7) % 8) + (y + 7) % 8;
      std::array<Sum, kWide> wide{};
      if (bricks[0] >= 0) wide.front() = row_of(bricks[0], row)[codec::kBrickEdge - 1];
      if (bricks[2] >= 0) wide.back() = row_of(bricks[2], row)[0];
      if (bricks[1] >= 0) {
        const auto middle = row_of(bricks[1], row);
        for (int x = 0; x < codec::kBrickEdge; ++x) wide[x + 1] = middle[x];
      }
      for (int x = 0; x < codec::kBrickEdge; ++x) to[x] = wide[x] + wide[x + 1] + wide[x + 2];
    }
  }
  constexpr int kLayer = kWide * codec::kBrickEdge;
  std::array<Sum, 512> sums{};
  for (int z = 0; z < codec::kBrickEdge; ++z) {
    std::array<Sum, kLayer> along_z;
    const Sum* from = &along_x[z * kLayer];
    for (int i = 0; i < kLayer; ++i) along_z[i] = from[i] + from[i + kLayer] + from[i + 2 * kLayer];
    for (int i = 0; i < 64; ++i) {
      sums[64 * z + i] =
          along_z[i] + along_z[i + codec::kBrickEdge] + along_z[i + 2 * codec::kBrickEdge];
    }
  }
  return sums;
}

/// Bit-sliced counters: one number from 0 to 27 for every voxel of a brick. bit[k] holds the k-th
/// bits of all, so that 64 voxels are counted at once.
struct BrickCounts {
  std::array<codec::Brick, 5> bit{};
};

namespace brick_counts {

/// Sum and carry of bits of equal value.
struct Sum {
  uint64_t value, carry;
};
inline Sum add(uint64_t a, uint64_t b) { return {a ^ b, a & b}; }
inline Sum add(uint64_t a, uint64_t b, uint64_t c) { return {a ^ b ^ c, (a & b) | (c & (a ^ b))}; }

/// Counts of three neighbours along a row, 0 to 3. Bit 8 y + x; the ends of the rows come from the
/// bricks before and after.
inline Sum along_x(uint64_t before, uint64_t row, uint64_t after) {
  constexpr uint64_t kFirst = 0x0101010101010101, kLast = kFirst << 7;
  return add((row << 1 & ~kFirst) | (before >> 7 & kFirst), row,
             (row >> 1 & ~kLast) | (after << 7 & kLast));
}

/// Counts of the nine neighbours within a layer, 0 to 9.
using Layer = std::array<uint64_t, 4>;

inline Layer along_x_and_y(const std::array<uint64_t, 9>& layers) {
  std::array<Sum, 3> rows;  // of three bricks along y
  for (int y = 0; y < 3; ++y) {
    rows[y] = along_x(layers[3 * y], layers[3 * y + 1], layers[3 * y + 2]);
  }
  const auto before = [](uint64_t brick, uint64_t here) { return here << 8 | brick >> 56; };
  const auto after = [](uint64_t brick, uint64_t here) { return here >> 8 | brick << 56; };
  const Sum ones =
      add(before(rows[0].value, rows[1].value), rows[1].value, after(rows[2].value, rows[1].value));
  const Sum twos =
      add(before(rows[0].carry, rows[1].carry), rows[1].carry, after(rows[2].carry, rows[1].carry));
  const Sum with_carry = add(twos.value, ones.carry);
  const Sum fours = add(twos.carry, with_carry.carry);
  return {ones.value, with_carry.value, fours.value, fours.carry};
}

/// Sum of three layers, 0 to 27.
inline std::array<uint64_t, 5> along_z(const Layer& a, const Layer& b, const Layer& c) {
  const Sum ones = add(a[0], b[0], c[0]);
  const Sum twos = add(a[1], b[1], c[1]), twos_all = add(twos.value, ones.carry);
  const Sum fours = add(a[2], b[2], c[2]);
  const Sum fours_all = add(fours.value, twos.carry, twos_all.carry);
  const Sum eights = add(a[3], b[3], c[3]);
  const Sum eights_all = add(eights.value, fours.carry, fours_all.carry);
  return {ones.value, twos_all.value, fours_all.value, eights_all.value,
          eights.carry | eights_all.carry};
}

}  // namespace brick_counts

/// Number of set voxels among the 27 in and around each voxel. layer_of(brick, z) gives the 64 bits
/// of a layer, y after y; layers of bricks that are not stored count as 0.
template <class LayerOf>
BrickCounts neighbourhood_counts(const BricksAround& around, const LayerOf& layer_of) {
  using brick_counts::Layer;
  std::array<Layer, codec::kBrickEdge + 2> flat;
  for (int z = 0; z < codec::kBrickEdge + 2; ++z) {
    const int brick_z = z == 0 ? 0 : z > codec::kBrickEdge ? 2 : 1;
    std::array<uint64_t, 9> layers{};
    for (int n = 0; n < 9; ++n) {
      const int brick = around[9 * brick_z + n];
      if (brick >= 0) layers[n] = layer_of(static_cast<size_t>(brick), (z + 7) % 8);
    }
    flat[z] = brick_counts::along_x_and_y(layers);
  }
  BrickCounts counts;
  for (int z = 0; z < codec::kBrickEdge; ++z) {
    const auto sums = brick_counts::along_z(flat[z], flat[z + 1], flat[z + 2]);
    for (size_t k = 0; k < sums.size(); ++k) counts.bit[k][z] = sums[k];
  }
  return counts;
}

/// The set voxels and all that share a face or an edge with one (18 neighbours, as in
/// MarchingCubes). layer_of(brick, z) as in neighbourhood_counts().
template <class LayerOf>
codec::Brick dilated(const BricksAround& around, const LayerOf& layer_of) {
  constexpr uint64_t kFirst = 0x0101010101010101, kLast = kFirst << 7;
  const auto along_y = [](uint64_t before, uint64_t here, uint64_t after) {
    return (here << 8 | before >> 56) | (here >> 8 | after << 56);
  };
  codec::Brick result{};
  for (int z = -1; z <= codec::kBrickEdge; ++z) {
    const int brick_z = z < 0 ? 0 : z == codec::kBrickEdge ? 2 : 1;
    std::array<uint64_t, 9> layers{};
    uint64_t any = 0;
    for (int n = 0; n < 9; ++n) {
      const int brick = around[9 * brick_z + n];
      if (brick >= 0) any |= layers[n] = layer_of(static_cast<size_t>(brick), (z + 8) % 8);
    }
    if (any == 0) continue;
    std::array<uint64_t, 3> rows;  // dilated along x, of three bricks along y
    for (int y = 0; y < 3; ++y) {
      const uint64_t row = layers[3 * y + 1];
      rows[y] = row | (row << 1 & ~kFirst) | (layers[3 * y] >> 7 & kFirst) | (row >> 1 & ~kLast) |
                (layers[3 * y + 2] << 7 & kLast);
    }
    const uint64_t cross = rows[1] | along_y(layers[1], layers[4], layers[7]);
    if (z > 0) result[z - 1] |= cross;
    if (z + 1 < codec::kBrickEdge) result[z + 1] |= cross;
    if (z >= 0 && z < codec::kBrickEdge) result[z] |= rows[1] | along_y(rows[0], rows[1], rows[2]);
  }
  return result;
}

/// The voxels where `a` is larger than `b`.
inline codec::Brick larger(const BrickCounts& a, const BrickCounts& b) {
  codec::Brick larger{};
  for (size_t z = 0; z < larger.size(); ++z) {
    uint64_t equal = ~uint64_t{0};
    for (size_t k = a.bit.size(); k-- > 0;) {
      larger[z] |= equal & a.bit[k][z] & ~b.bit[k][z];
      equal &= ~(a.bit[k][z] ^ b.bit[k][z]);
    }
  }
  return larger;
}

}  // namespace v3d::recon
