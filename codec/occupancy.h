// A volume as it is coded: its bricks in the box that just holds them.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "codec/brick_surface.h"

namespace v3d {

/// Brick (0, 0, 0) of `volume` is brick `first` of the grid. Sorted by z, then y, then x; no stored
/// brick is empty. Keeps its memory.
struct Occupancy {
  /// Of the box that a decoder accepts, and of the bricks in it that are not empty.
  static constexpr int64_t kMostInBox = int64_t{1} << 24;
  static constexpr size_t kMostBricks = size_t{1} << 17;
  /// Of `first` and of the box along an axis: half voxels then fit 16 bits.
  static constexpr int kMostAlongAxis = 4096;

  std::array<int, 3> first{};
  BrickMap occupied;
  std::vector<Brick> bricks;
  std::vector<BrickCoord> coords;

  const std::array<int, 3>& counts() const { return occupied.counts(); }
  BrickVolume view() const { return {&occupied, bricks, coords}; }
  /// No brick in a box of that size, at `at`.
  void clear(const std::array<int, 3>& at, const std::array<int, 3>& size);
  /// The volume's bricks in the smallest box that holds them. False for a volume beyond the limits.
  bool assign(const BrickVolume& volume);
};

std::vector<uint8_t> encode_occupancy(const Occupancy& volume);

/// Fills the box that `volume` was cleared to. False for bytes that are not exactly an encoder's
/// length, or that hold more than kMostBricks.
/// Time is bounded by the size of the box and of the bytes.
bool decode_occupancy(std::span<const uint8_t> bytes, Occupancy& volume);

}  // namespace v3d
