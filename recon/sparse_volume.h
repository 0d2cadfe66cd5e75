// The volume: which voxels of a grid are occupied, stored only where there are any.
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "recon/voxel_grid.h"

namespace v3d {

/// 8 x 8 x 8 voxels: voxel (x, y, z) of the brick is bit 8 * y + x (least significant first) of
/// word z.
using Brick = std::array<uint64_t, 8>;

inline constexpr int kBrickEdge = 8;
inline constexpr uint64_t kFullLayer = ~uint64_t{0};
inline constexpr Brick kFullBrick{kFullLayer, kFullLayer, kFullLayer, kFullLayer,
                                  kFullLayer, kFullLayer, kFullLayer, kFullLayer};

/// Brick (x, y, z) holds voxels 8x .. 8x+7, 8y .. 8y+7, 8z .. 8z+7.
struct BrickCoord {
  int x = 0;
  int y = 0;
  int z = 0;
  friend bool operator==(const BrickCoord&, const BrickCoord&) = default;
};

struct PlacedBrick {
  BrickCoord at;
  Brick bits{};
};

/// Bits that are set. A plain x86-64 has no instruction for it, and std::popcount() is a call
/// there.
constexpr int bit_count(uint64_t x) {
  x -= x >> 1 & 0x5555555555555555;
  x = (x & 0x3333333333333333) + (x >> 2 & 0x3333333333333333);
  x = (x + (x >> 4)) & 0x0F0F0F0F0F0F0F0F;
  return static_cast<int>(x * 0x0101010101010101 >> 56);
}

/// The bits of brick `at` that lie inside the grid.
Brick bits_inside(const VoxelGrid& grid, BrickCoord at);

/// A value; safe to read from any thread. Invariants: no stored brick is empty; bits outside the
/// grid are 0; bricks are sorted by z, then y, then x. So equal volumes have equal bytes.
class SparseVolume {
 public:
  SparseVolume() = default;
  /// No voxel occupied.
  explicit SparseVolume(const VoxelGrid& grid);
  /// `parts` hold distinct bricks in any order, with no bit outside the grid; empty ones are left
  /// out. The result does not depend on the order, nor on how they are spread over the parts. Runs
  /// in the caller's TBB arena.
  SparseVolume(const VoxelGrid& grid, std::span<const std::span<const PlacedBrick>> parts);
  /// As if newly constructed; keeps its memory.
  void assign(const VoxelGrid& grid, std::span<const std::span<const PlacedBrick>> parts);

  const VoxelGrid& grid() const { return grid_; }
  /// Bricks along each axis, occupied or not.
  const std::array<int, 3>& brick_counts() const { return brick_counts_; }

  /// The occupied bricks, sorted; coords()[n] is where bricks()[n] lies.
  std::span<const Brick> bricks() const { return bricks_; }
  std::span<const BrickCoord> coords() const { return coords_; }

  /// Index into bricks(), -1 for an empty brick and outside the grid.
  int index_of(BrickCoord at) const {
    if (at.x < 0 || at.y < 0 || at.z < 0 || at.x >= brick_counts_[0] || at.y >= brick_counts_[1] ||
        at.z >= brick_counts_[2]) {
      return -1;
    }
    const size_t w = word_of(at);
    const uint64_t bit = bit_of(at);
    return (occupied_[w] & bit) != 0 ? first_[w] + bit_count(occupied_[w] & (bit - 1)) : -1;
  }

  /// A bit for every brick of row (y, z), set where it is occupied: brick x is bit x % 64 of word
  /// x / 64. Requires a row inside the grid.
  std::span<const uint64_t> occupied_in_row(int y, int z) const {
    return {&occupied_[word_of({0, y, z})], static_cast<size_t>(words_per_row_)};
  }

  /// Outside the grid everything is empty.
  bool get(int i, int j, int k) const;
  /// Occupied voxels.
  int64_t count() const;

  friend bool operator==(const SparseVolume& a, const SparseVolume& b) {
    return a.grid_ == b.grid_ && a.coords_ == b.coords_ && a.bricks_ == b.bricks_;
  }

 private:
  size_t word_of(BrickCoord at) const {
    return (static_cast<size_t>(at.z) * brick_counts_[1] + at.y) * words_per_row_ + at.x / 64;
  }
  static uint64_t bit_of(BrickCoord at) { return uint64_t{1} << (at.x % 64); }
  /// Sets the bits of the occupied bricks and makes room for them.
  void mark(std::span<const std::span<const PlacedBrick>> parts);
  void place(std::span<const std::span<const PlacedBrick>> parts);

  VoxelGrid grid_;
  std::array<int, 3> brick_counts_{};
  std::vector<Brick> bricks_;
  std::vector<BrickCoord> coords_;
  int words_per_row_ = 0;
  std::vector<uint64_t> occupied_;  ///< occupied_in_row() for all rows, by z and then y
  std::vector<int32_t> first_;      ///< index of the first brick of each word of occupied_
};

}  // namespace v3d
