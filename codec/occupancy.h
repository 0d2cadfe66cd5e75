// Codec of the occupancy of a volume: its bricks in their bounding box.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "codec/bricks.h"

namespace v3d::codec {

/// Occupied bricks of a bounding box. Brick (0, 0, 0) of the box is brick `first` of the grid.
/// Bricks are sorted by z, then y, then x; no stored brick is empty. Keeps its memory.
struct Occupancy {
  /// Maximum number of bricks in the box, and of bricks in it that are not empty.
  static constexpr int64_t kMaxBoxBricks = int64_t{1} << 24;
  static constexpr size_t kMaxBricks = size_t{1} << 17;
  /// Maximum number of words of the box: each row along x has whole words of 64 bricks, so a narrow
  /// box of as many bricks takes more memory.
  static constexpr int64_t kMaxBoxWords = int64_t{1} << 20;
  /// Maximum of `first` plus the size of the box along an axis, bricks: half voxels then fit 16
  /// bits.
  static constexpr int kMaxAlongAxis = 4096;

  std::array<int, 3> first{};
  BrickMap occupied;
  std::vector<Brick> bricks;
  std::vector<BrickCoord> coords;

  /// Whether a box of this size, bricks, is within kMaxBoxBricks and kMaxBoxWords. Each side is at
  /// most kMaxAlongAxis.
  static bool box_fits(const std::array<int, 3>& size);

  const std::array<int, 3>& counts() const { return occupied.counts(); }
  BrickVolume view() const { return {&occupied, bricks, coords}; }
  /// Removes all bricks and sets the box: `size` bricks from brick `at`.
  void clear(const std::array<int, 3>& at, const std::array<int, 3>& size);
  /// Copies the bricks of `volume` into the smallest box that holds them. False when the volume
  /// exceeds the limits.
  bool assign(const BrickVolume& volume);
};

std::vector<uint8_t> encode_occupancy(const Occupancy& volume);

/// Fills the box that was set with volume.clear(). False when the bytes do not have exactly the
/// length that an encoder writes, or when they hold more than kMaxBricks.
/// Time is bounded by the size of the box and of the bytes.
bool decode_occupancy(std::span<const uint8_t> bytes, Occupancy& volume);

}  // namespace v3d::codec
