// Sets of voxels of a volume.
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "codec/bricks.h"

namespace v3d::recon {

/// A set of voxels of a volume: one brick for each of SparseVolume::bricks().
using VoxelSet = std::vector<codec::Brick>;

inline bool is_empty(const codec::Brick& brick) { return brick == codec::kEmptyBrick; }

inline int64_t voxel_count(const codec::Brick& brick) {
  int64_t count = 0;
  for (const uint64_t layer : brick) count += codec::bit_count(layer);
  return count;
}

inline codec::Brick common(const codec::Brick& a, const codec::Brick& b) {
  codec::Brick both{};
  for (size_t z = 0; z < both.size(); ++z) both[z] = a[z] & b[z];
  return both;
}

inline void add(codec::Brick& to, const codec::Brick& more) {
  for (size_t z = 0; z < to.size(); ++z) to[z] |= more[z];
}

inline void subtract(codec::Brick& from, const codec::Brick& less) {
  for (size_t z = 0; z < from.size(); ++z) from[z] &= ~less[z];
}

}  // namespace v3d::recon
